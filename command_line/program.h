// Common parts of all Sprag programs: options, exit codes, a stop flag, the JSON report.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "command_line/named_files.h"
#include "command_line/signals.h"
#include "lcmtypes/bus.h"
#include "lcmtypes/refusal.h"
#include "sprag/detail/mechanics/interrupt.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace sprag {

struct Scene;

inline constexpr int exit_done = 0;
inline constexpr int exit_failed = 1;  ///< failed while running
inline constexpr int exit_usage = 2;   ///< bad usage or input

/// Bad usage that is detected after parsing; run_program() exits with 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An output, possibly the report, would overwrite an input; run_program() exits with 2 and writes
/// no report.
struct OverwriteError : UsageError {
  using UsageError::UsageError;
};

struct CommonOptions {
  std::string url = default_url;
  std::filesystem::path report;    ///< empty: none
  std::filesystem::path key;       ///< empty: messages are neither signed nor verified
  bool runs_until_signal = false;  ///< a signal is the regular end, not a failure
  /// The files that the options name, to be called after parsing. run_program() checks that no file
  /// overwrites another one.
  std::vector<std::function<NamedFile()>> files;
};

/// An empty command line. Programs that use only the options below need not include CLI11, which
/// takes longer to compile than most other code.
std::shared_ptr<CLI::App> command_line(const std::string& description, const std::string& name);

/// Adds --url, --key, --report and --version, which prints "NAME VERSION" with the app's name.
/// CLI11 adds --help.
void add_common_options(CLI::App& app, CommonOptions& options);

/// Adds an option, or an argument (which is required), for a file that the program reads or writes.
/// `file` and `options` must stay valid until run_program() returns.
CLI::Option* add_file(CLI::App& app, CommonOptions& options, const std::string& name,
                      NamedFile::Use use, std::filesystem::path& file, const std::string& type,
                      const std::string& help);

/// Adds the argument SCENE: a file, or the name of a shipped scene. `file` receives the file.
CLI::Option* add_scene(CLI::App& app, CommonOptions& options, std::filesystem::path& file);

/// Adds the arguments [EVENTS] SCENE: of one argument alone `events` stays empty.
void add_events_and_scene(CLI::App& app, CommonOptions& options, std::filesystem::path& events,
                          std::filesystem::path& scene);

/// read_scene() of sprag/scene_file.h; prints its remarks to stderr. To be called before any output
/// is opened: throws OverwriteError if an output would overwrite a file that the scene names.
Scene load_scene(const std::filesystem::path& file, const CommonOptions& options);

/// Adds a flag that sets `value`, or clears it if the name begins with '!'.
CLI::Option* add_flag(CLI::App& app, const std::string& name, bool& value, const std::string& help);

/// The option is valid only together with the other one, or only without it.
void needs(CLI::Option* option, CLI::Option* other);
void excludes(CLI::Option* option, CLI::Option* other);

/// Makes an option mandatory.
void require(CLI::Option* option);

/// Adds an option whose value is one of `choices`; `take` receives the index of the chosen one. Any
/// other value is bad usage, and the message lists the choices.
CLI::Option* add_choice(CLI::App& app, const std::string& name, std::vector<std::string> choices,
                        std::function<void(std::size_t)> take, const std::string& help);

/// The same for choices that stand for values.
template <class Value>
CLI::Option* add_choice(CLI::App& app, const std::string& name, Value& value,
                        const std::vector<std::pair<std::string, Value>>& choices,
                        const std::string& help) {
  std::vector<std::string> names;
  names.reserve(choices.size());
  for (const auto& choice : choices) names.push_back(choice.first);
  const auto take = [&value, choices](std::size_t i) { value = choices[i].second; };
  return add_choice(app, name, std::move(names), take, help);
}

/// Message about an invalid choice: "kalman; choose replica, timing or both".
std::string choose(const std::string& given, std::span<const std::string> choices);

/// Adds an option that takes a finite number > 0, in `unit`; anything else is bad usage.
CLI::Option* add_positive(CLI::App& app, const std::string& name, double& value,
                          const std::string& unit, const std::string& help);

/// The same; "max" is allowed too and means infinity.
CLI::Option* add_positive_or_max(CLI::App& app, const std::string& name, double& value,
                                 const std::string& unit, const std::string& help);

/// Adds an option that takes a whole number from 1 to `most`; anything else is bad usage.
CLI::Option* add_count(CLI::App& app, const std::string& name, int& value, const std::string& unit,
                       const std::string& help, int most = std::numeric_limits<int>::max());

/// Adds an option that takes any text. `type` names its kind in the help.
CLI::Option* add_text(CLI::App& app, const std::string& name, std::string& value,
                      const std::string& type, const std::string& help);

/// The key of the option --key, if present. Throws InputError.
std::optional<Key> key_of(const CommonOptions& options);

/// Counts of refused messages by cause: first those that reached the program's handlers, by
/// Refusal, then those that the bus discarded. Causes that did not occur are omitted.
nlohmann::ordered_json refusals(const std::array<std::int64_t, refusal_kinds>& refused,
                                const BusCounts& bus);

/// Prints the result of a program: `object` goes into the report and, with `json`, to stdout as one
/// JSON object; otherwise `text` goes to stdout through printable_lines(). Throws
/// std::runtime_error if stdout cannot be written.
void print_result(const nlohmann::ordered_json& object, const std::string& text, bool json,
                  nlohmann::ordered_json& report);

/// Prints what a long computation is doing to stderr: after 2 s, and then at most once a second.
std::function<void(std::string_view)> progress_on_stderr();

/// Parses the command line, then calls `run`, which fills the report and returns an exit code.
/// Until it returns, all output to std::cerr passes through printable_lines(), so that names in
/// messages cannot send control characters to a terminal.
///
/// Returns the exit code of the process. 2: bad command line, UsageError, UrlError, InputError,
/// SceneError or ModelError; also if an output would overwrite another file of `options` or a file
/// of the scene, and then no output is opened, not even the report. 1: any other exception, whose
/// what() is printed to stderr, or a report that cannot be written. The report also contains
/// program, version, command (its arguments), exit and error.
int run_program(int argc, const char* const* argv, CLI::App& app, const CommonOptions& options,
                const std::function<int(nlohmann::ordered_json& report)>& run);

}  // namespace sprag
