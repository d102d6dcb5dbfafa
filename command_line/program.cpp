#include "command_line/program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <system_error>

#include "command_line/signals.h"
#include "command_line/standard_files.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/text/printable.h"
#include "sprag/model.h"
#include "sprag/scene_file.h"
#include "sprag/version.h"

namespace sprag {

namespace {

// Adds an option whose text `read` converts to a number; `allowed` describes the valid numbers.
template <class Read>
CLI::Option* add_number(CLI::App& app, const std::string& name, double& value,
                        const std::string& unit, const std::string& help, const char* allowed,
                        Read read) {
  const auto store = [&value, name, allowed, read](const std::string& text) {
    const std::optional<double> number = read(text);
    if (!number) throw CLI::ValidationError(name, text + " is not allowed; must be " + allowed);
    value = *number;
  };
  return app.add_option_function<std::string>(name, store, help)->type_name(unit);
}

std::optional<double> positive(const std::string& text) {
  const std::optional<double> number = parse_double(text);
  return number && *number > 0.0 ? number : std::nullopt;
}

std::optional<double> positive_or_max(const std::string& text) {
  return text == "max" ? std::optional(std::numeric_limits<double>::infinity()) : positive(text);
}

/// The log file of a URL file://LOG or file://LOG?mode=w.
NamedFile log_of(const std::string& url) {
  using Use = NamedFile::Use;
  const LcmUrl parsed = parse_url(url);
  return {"--url", parsed.log, parsed.writes_log ? Use::written : Use::read};
}

std::vector<NamedFile> named_files(const CommonOptions& options) {
  std::vector<NamedFile> files;
  for (const auto& file : options.files) files.push_back(file());
  return files;
}

std::string line_of(const nlohmann::ordered_json& object) {
  return printable_lines(
             object.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) +
         "\n";
}

bool write_report(const std::filesystem::path& file, const nlohmann::ordered_json& report) {
  OutputFile output(file);
  output.write(line_of(report));
  if (!output.close()) std::cerr << output.error() << '\n';
  return output.good();
}

/// Prints the help, the version, or the error of the command line. Returns the exit code.
int answer(const CLI::App& app, const CLI::ParseError& what) {
  std::ostringstream text;
  if (app.exit(what, text, std::cerr) != 0) return exit_usage;
  OutputFile out = OutputFile::standard_output();
  out.write(text.str());
  if (out.close()) return exit_done;
  std::cerr << app.get_name() << ": " << out.error() << '\n';
  return exit_failed;
}

struct Outcome {
  int code = exit_done;
  std::string error;   // empty: none
  bool lines = false;  // line breaks in `error` are intended; otherwise they belong to a name
};

/// Calls `run` and converts exceptions, except OverwriteError, to an exit code and a message.
Outcome guarded(const std::function<int(nlohmann::ordered_json&)>& run,
                const CommonOptions& options, nlohmann::ordered_json& report) {
  try {
    return {run(report), {}};
  } catch (const Interrupted& e) {
    if (options.runs_until_signal) return {exit_done, {}};
    return {exit_failed, e.what()};
  } catch (const OverwriteError&) {
    throw;
  } catch (const UsageError& e) {
    return {exit_usage, e.what()};
  } catch (const UrlError& e) {
    return {exit_usage, e.what()};
  } catch (const InputError& e) {
    return {exit_usage, e.what()};
  } catch (const SceneError& e) {
    return {exit_usage, e.what()};
  } catch (const ModelError& e) {
    return {exit_usage, e.what()};
  } catch (const BusError& e) {
    return {exit_failed, e.what(), true};
  } catch (const std::exception& e) {
    return {exit_failed, e.what()};
  }
}

/// The folder of the scenes that are shipped with this program, in its build tree or installation;
/// empty if there is none.
std::filesystem::path scenes_folder() {
  std::error_code error;
  return shipped_scenes(std::filesystem::read_symlink("/proc/self/exe", error));
}

}  // namespace

std::shared_ptr<CLI::App> command_line(const std::string& description, const std::string& name) {
  return std::make_shared<CLI::App>(description, name);
}

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
  options.files.emplace_back([&options] { return log_of(options.url); });
  add_file(app, options, "--key", NamedFile::Use::read, options.key, "FILE",
           "Sign all messages, and accept only signed ones");
  add_file(app, options, "--report", NamedFile::Use::written, options.report, "FILE.json",
           "Write the run's figures to this file");
}

void print_result(const nlohmann::ordered_json& object, const std::string& text, bool json,
                  nlohmann::ordered_json& report) {
  report.update(object);
  OutputFile out = OutputFile::standard_output();
  out.write(json ? line_of(object) : printable_lines(text));
  if (!out.close()) throw std::runtime_error(out.error());
}

CLI::Option* add_file(CLI::App& app, CommonOptions& options, const std::string& name,
                      NamedFile::Use use, std::filesystem::path& file, const std::string& type,
                      const std::string& help) {
  options.files.emplace_back([name, use, &file] { return NamedFile{name, file, use}; });
  return app.add_option(name, file, help)->type_name(type)->required(!name.starts_with('-'));
}

CLI::Option* add_scene(CLI::App& app, CommonOptions& options, std::filesystem::path& file) {
  options.files.emplace_back([&file] { return NamedFile{"SCENE", file, NamedFile::Use::read}; });
  const auto take = [&file](const std::string& given) {
    file = find_scene(given, scenes_folder());
  };
  return app
      .add_option_function<std::string>(
          "SCENE", take, "Scene: a file (TOML), or the name of one that `sprag scenes` lists")
      ->type_name("")
      ->required();
}

void add_events_and_scene(CLI::App& app, CommonOptions& options, std::filesystem::path& events,
                          std::filesystem::path& scene) {
  add_file(app, options, "EVENTS", NamedFile::Use::read, events, "", "LCM log or events CSV")
      ->required(false);
  add_scene(app, options, scene)->required(false);
  app.parse_complete_callback([&events, &scene] {
    if (events.empty()) throw CLI::RequiredError("SCENE");
    if (!scene.empty()) return;
    scene = find_scene(events, scenes_folder());
    events.clear();
  });
}

Scene load_scene(const std::filesystem::path& file, const CommonOptions& options) {
  std::vector<NamedFile> files = named_files(options);
  if (const std::string why = scene_not_found(file, scenes_folder()); !why.empty()) {
    throw SceneError(file.string(), "cannot be read: " + why);
  }
  const auto refuse_overwriting = [&files](const std::filesystem::path& named) {
    files.push_back({"a file of SCENE", named, NamedFile::Use::read});
    if (const std::string clash = overwritten(files); !clash.empty()) throw OverwriteError(clash);
    files.pop_back();
  };
  Scene scene = read_scene(file, refuse_overwriting);
  for (const std::string& remark : scene.remarks) std::cerr << remark << '\n';
  return scene;
}

CLI::Option* add_flag(CLI::App& app, const std::string& name, bool& value,
                      const std::string& help) {
  if (!name.starts_with('!')) return app.add_flag(name, value, help);
  return app.add_flag_callback(
      name.substr(1), [&value] { value = false; }, help);
}

void needs(CLI::Option* option, CLI::Option* other) { option->needs(other); }

void excludes(CLI::Option* option, CLI::Option* other) { option->excludes(other); }

void require(CLI::Option* option) { option->required(); }

std::string choose(const std::string& given, std::span<const std::string> choices) {
  std::string text = given + "; choose ";
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 < choices.size() ? ", " : " or ";
    text += choices[i];
  }
  return text;
}

CLI::Option* add_choice(CLI::App& app, const std::string& name, std::vector<std::string> choices,
                        std::function<void(std::size_t)> take, const std::string& help) {
  std::string type;
  for (const std::string& choice : choices) type += (type.empty() ? "" : "|") + choice;
  const auto store = [name, choices = std::move(choices),
                      take = std::move(take)](const std::string& text) {
    const auto found = std::find(choices.begin(), choices.end(), text);
    if (found == choices.end()) throw CLI::ValidationError(name, choose(text, choices));
    take(static_cast<std::size_t>(found - choices.begin()));
  };
  return app.add_option_function<std::string>(name, store, help)->type_name(type);
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
  return add_number(app, name, value, unit, help, "a finite number > 0", positive);
}

CLI::Option* add_positive_or_max(CLI::App& app, const std::string& name, double& value,
                                 const std::string& unit, const std::string& help) {
  return add_number(app, name, value, unit, help, "a finite number > 0 or max", positive_or_max);
}

CLI::Option* add_count(CLI::App& app, const std::string& name, int& value, const std::string& unit,
                       const std::string& help, int most) {
  const auto store = [&value, name, most](const std::string& text) {
    const auto number = parse_integer(text);
    if (!number || *number < 1 || *number > most) {
      const bool limited = most < std::numeric_limits<int>::max();
      throw CLI::ValidationError(
          name, text + " is not allowed; must be a whole number " +
                    (limited ? "from 1 to " + std::to_string(most) : std::string("> 0")));
    }
    value = static_cast<int>(*number);
  };
  return app.add_option_function<std::string>(name, store, help)->type_name(unit);
}

CLI::Option* add_text(CLI::App& app, const std::string& name, std::string& value,
                      const std::string& type, const std::string& help) {
  return app.add_option(name, value, help)->type_name(type);
}

std::function<void(std::string_view)> progress_on_stderr() {
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds silence(2), interval(1);
  return [start = Clock::now(), next = Clock::now() + silence](std::string_view what) mutable {
    const Clock::time_point now = Clock::now();
    if (now < next) return;
    next = now + interval;
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - start).count();
    std::cerr << seconds << " s: " << what << '\n';
  };
}

int run_program(int argc, const char* const* argv, CLI::App& app, const CommonOptions& options,
                const std::function<int(nlohmann::ordered_json& report)>& run) {
  open_standard_files();
  const Signals signals(app.get_name());
  const PrintableStream messages(std::cerr);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return answer(app, e);
  }
  if (const std::string clash = overwritten(named_files(options)); !clash.empty()) {
    std::cerr << app.get_name() << ": " << printable(clash) << '\n';
    return exit_usage;
  }
  nlohmann::ordered_json report{{"program", app.get_name()},
                                {"version", SPRAG_VERSION},
                                {"command", std::vector<std::string>(argv + 1, argv + argc)}};
  Outcome outcome;
  try {
    outcome = guarded(run, options, report);
  } catch (const OverwriteError& e) {
    std::cerr << app.get_name() << ": " << printable(e.what()) << '\n';
    return exit_usage;
  }
  if (const std::string& error = outcome.error; !error.empty()) {
    std::cerr << app.get_name() << ": " << (outcome.lines ? error : printable(error)) << '\n';
    report["error"] = error;
  }
  report["exit"] = outcome.code;
  if (!options.report.empty() && !write_report(options.report, report)) return exit_failed;
  return outcome.code;
}

}  // namespace sprag
