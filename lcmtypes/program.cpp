#include "lcmtypes/program.h"

#include <atomic>
#include <csignal>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>

#include "mechanics/csv.h"
#include "mechanics/model.h"
#include "mechanics/output_file.h"
#include "mechanics/scene.h"

namespace sprag {

namespace {

std::atomic<bool> stop_flag = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");

void catch_signals() {
  stop_flag = false;
  struct sigaction action {};
  action.sa_handler = [](int) { stop_flag = true; };
  action.sa_flags = SA_RESTART;  // poll() and sleeps return all the same
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);  // a closed pipe is a write that fails, and is reported
}

CLI::Option* add_number(CLI::App& app, const std::string& name, double& value,
                        const std::string& unit, const std::string& help, bool max_allowed) {
  const auto store = [&value, name, max_allowed](const std::string& text) {
    const auto number = max_allowed && text == "max"
                            ? std::optional(std::numeric_limits<double>::infinity())
                            : parse_double(text);
    if (!number || !(*number > 0.0))
      throw CLI::ValidationError(name, text + " is not allowed; must be a finite number > 0" +
                                           (max_allowed ? " or max" : ""));
    value = *number;
  };
  return app.add_option_function<std::string>(name, store, help)->type_name(unit);
}

bool write_report(const std::filesystem::path& file, const nlohmann::ordered_json& report) {
  OutputFile output(file);
  output.write(report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  output.write("\n");
  if (!output.close()) std::cerr << output.error() << '\n';
  return output.good();
}

/// Runs and turns exceptions into an exit code and a message.
int guarded(const std::function<int(nlohmann::ordered_json&)>& run, nlohmann::ordered_json& report,
            std::string& error) {
  try {
    return run(report);
  } catch (const UsageError& e) {
    error = e.what();
  } catch (const UrlError& e) {
    error = e.what();
  } catch (const InputError& e) {
    error = e.what();
  } catch (const SceneError& e) {
    error = e.what();
  } catch (const ModelError& e) {
    error = e.what();
  } catch (const std::exception& e) {
    error = e.what();
    return exit_failed;
  }
  return exit_usage;
}

}  // namespace

bool stop_requested() noexcept { return stop_flag; }

void add_common_options(CLI::App& app, CommonOptions& options) {
  app.set_version_flag("--version", app.get_name() + " " SPRAG_VERSION);
  app.add_option("--url", options.url, "LCM address")
      ->type_name("LCM_URL")
      ->capture_default_str()
      ->check([](const std::string& text) -> std::string {
        try {
          parse_url(text);
          return {};
        } catch (const UrlError& e) {
          return e.what();
        }
      });
  app.add_option("--key", options.key, "Sign all messages, and hear only signed ones")
      ->type_name("FILE");
  app.add_option("--report", options.report, "Write the run's figures to this file")
      ->type_name("FILE.json");
}

std::optional<Key> key_of(const CommonOptions& options) {
  if (options.key.empty()) return std::nullopt;
  return Key(options.key);
}

nlohmann::ordered_json refusals(const std::array<std::int64_t, refusal_kinds>& refused,
                                const BusCounts& bus) {
  nlohmann::ordered_json counts = nlohmann::ordered_json::object();
  const auto add = [&counts](std::string_view cause, std::int64_t count) {
    if (count > 0) counts[std::string(cause)] = count;
  };
  for (int i = 1; i < refusal_kinds; ++i) {
    add(name(static_cast<Refusal>(i)), refused[static_cast<std::size_t>(i)]);
  }
  for (int i = 1; i < packet_faults; ++i) {
    add(name(static_cast<PacketFault>(i)), bus.faults[static_cast<std::size_t>(i)]);
  }
  add("unauthenticated", bus.unauthenticated);
  add("other_host", bus.other_host);
  return counts;
}

CLI::Option* add_positive(CLI::App& app, const std::string& name, double& value,
                          const std::string& unit, const std::string& help) {
  return add_number(app, name, value, unit, help, false);
}

CLI::Option* add_positive_or_max(CLI::App& app, const std::string& name, double& value,
                                 const std::string& unit, const std::string& help) {
  return add_number(app, name, value, unit, help, true);
}

int run_program(int argc, const char* const* argv, CLI::App& app, const CommonOptions& options,
                const std::function<int(nlohmann::ordered_json& report)>& run) {
  catch_signals();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? exit_done : exit_usage;
  }
  nlohmann::ordered_json report{{"program", app.get_name()}, {"version", SPRAG_VERSION}};
  std::string error;
  int code = guarded(run, report, error);
  if (!error.empty()) {
    std::cerr << app.get_name() << ": " << error << '\n';
    report["error"] = error;
  }
  report["exit"] = code;
  if (!options.report.empty() && !write_report(options.report, report)) code = exit_failed;
  return code;
}

}  // namespace sprag
