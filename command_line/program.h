// What every Sprag executable shares: common options, exit codes, a stop flag, the JSON report.
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
#include <utility>
#include <vector>

#include "command_line/named_files.h"
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

/// Bad usage that only shows after parsing; run_program() exits with 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An output, maybe the report, would be written over an input; run_program() exits with 2 and
/// writes no report.
struct OverwriteError : UsageError {
  using UsageError::UsageError;
};

struct CommonOptions {
  std::string url = default_url;
  std::filesystem::path report;    ///< empty: none
  std::filesystem::path key;       ///< empty: messages are neither signed nor checked
  bool runs_until_signal = false;  ///< a signal is no failure, whatever the program is at
  /// The files that the options name, once they are parsed; run_program() sees to it that none is
  /// written over another.
  std::vector<std::function<NamedFile()>> files;
};

/// An empty command line. CLI11 takes longer to compile than most of the rest: a program whose
/// options are of the kinds below does without its headers.
std::shared_ptr<CLI::App> command_line(const std::string& description, const std::string& name);

/// Adds --url, --key, --report and --version ("NAME VERSION", with the app's name); CLI11 has
/// --help.
void add_common_options(CLI::App& app, CommonOptions& options);

/// Adds an option, or an argument, which is required, for a file that the program reads or writes.
/// `file` and `options` must stay in place until run_program() has returned.
CLI::Option* add_file(CLI::App& app, CommonOptions& options, const std::string& name,
                      NamedFile::Use use, std::filesystem::path& file, const std::string& type,
                      const std::string& help);

/// The folders of the scenes and of the studies that come with this program, in its build tree or
/// installation; empty if there are none.
std::filesystem::path scenes_folder();
std::filesystem::path studies_folder();

/// Adds the argument SCENE: a file, or a name in scenes_folder(), whose file
/// `file` then is.
CLI::Option* add_scene(CLI::App& app, CommonOptions& options, std::filesystem::path& file);

/// Adds the argument STUDY: a file, or a name in studies_folder().
CLI::Option* add_study(CLI::App& app, CommonOptions& options, std::filesystem::path& file);

/// read_scene() of sprag/scene_file.h; its remarks go to stderr. To be called before any
/// output is opened: throws OverwriteError where one would be written over a file that the scene
/// names.
Scene load_scene(const std::filesystem::path& file, const CommonOptions& options);

/// Adds a flag that sets `value`, or clears it if the name begins with '!'.
CLI::Option* add_flag(CLI::App& app, const std::string& name, bool& value, const std::string& help);

/// An option that can be given only with another one, or only without it.
void needs(CLI::Option* option, CLI::Option* other);
void excludes(CLI::Option* option, CLI::Option* other);

/// An option without which the program does not run.
void require(CLI::Option* option);

/// Adds an option that takes one of the names; `take` gets the index of the one that is given.
/// Another one is bad usage, and the message lists those that there are.
CLI::Option* add_choice(CLI::App& app, const std::string& name, std::vector<std::string> choices,
                        std::function<void(std::size_t)> take, const std::string& help);

/// The same for names that stand for values.
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

/// "kalman; choose replica, timing or both": what to say of a choice that is not there.
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

/// Adds --jobs n, threads, at most max_jobs.
inline constexpr int max_jobs = 1024;
CLI::Option* add_jobs(CLI::App& app, int& value);

/// Adds an argument for any number of files, at least one, that the program reads; `file_of` tells
/// which file is meant by a text.
CLI::Option* add_inputs(CLI::App& app, CommonOptions& options, const std::string& name,
                        std::vector<std::string>& texts,
                        std::function<std::filesystem::path(const std::string&)> file_of,
                        const std::string& help);

/// Adds an option that takes a finite number, in `unit`; anything else is bad usage.
CLI::Option* add_finite(CLI::App& app, const std::string& name, double& value,
                        const std::string& unit, const std::string& help);

/// Adds an option that takes names with commas between them; it may be repeated.
CLI::Option* add_names(CLI::App& app, const std::string& name, std::vector<std::string>& values,
                       const std::string& help);

/// Adds an option that takes any text, of this type by name.
CLI::Option* add_text(CLI::App& app, const std::string& name, std::string& value,
                      const std::string& type, const std::string& help);

/// The key of --key, if it is given. Throws InputError.
std::optional<Key> key_of(const CommonOptions& options);

/// Messages that a program has refused, by cause: first those that came to its handlers, by
/// Refusal, then what the bus kept away. Causes that did not occur are left out.
nlohmann::ordered_json refusals(const std::array<std::int64_t, refusal_kinds>& refused,
                                const BusCounts& bus);

/// What a program has found: `object` goes into the report and, with `json`, to stdout as one JSON
/// object; else `text` does, as printable_lines(). Throws std::runtime_error where stdout cannot be
/// written.
void print_result(const nlohmann::ordered_json& object, const std::string& text, bool json,
                  nlohmann::ordered_json& report);

/// Whether SIGINT, SIGTERM or SIGHUP has arrived since run_program() began. They interrupt poll()
/// and sleeps.
inline bool stop_requested() noexcept { return interrupted(); }

/// Parses the command line, then calls `run`, which fills the report and returns an exit code.
/// Until it returns, all that is written to std::cerr passes through printable_lines(): names in
/// messages cannot carry control characters to a terminal.
/// Returns the process's exit code: 2 for a bad command line, also if an output would be written
/// over another file of `options` or over one of its scene (then no output is opened, not even the
/// report), UsageError, UrlError, InputError, SceneError or ModelError, 1 for any other exception
/// (its what() goes to stderr) or a report that cannot be written. The report also says program,
/// version, exit and error.
int run_program(int argc, const char* const* argv, CLI::App& app, const CommonOptions& options,
                const std::function<int(nlohmann::ordered_json& report)>& run);

}  // namespace sprag
