#include "tools/import_events/options.h"

#include <CLI/CLI.hpp>
#include <string_view>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "tools/import_events/clock_time.h"
#include "tools/import_events/unit.h"

namespace sprag {
namespace {

void add_columns(CLI::App& app, const std::string& name, ColumnRole role,
                 std::vector<ColumnOption>& columns, const std::string& help) {
  const auto add = [&columns, role](const std::string& text) { columns.push_back({role, text}); };
  // Called for each option in turn, since contacts are numbered in the order of all these options.
  app.add_option_function<std::string>(name, add, help)
      ->trigger_on_parse()
      ->type_name("[CONTACT=]NAME");
}

}  // namespace

void add_import_options(CLI::App& app, ImportRun& run) {
  add_columns(app, "--impacts", ColumnRole::impacts, run.columns,
              "Column of impact times; repeatable");
  add_columns(app, "--on", ColumnRole::on, run.columns,
              "Column of times at which a contact closes; repeatable, each with an --off");
  add_columns(app, "--off", ColumnRole::off, run.columns, "Column of times at which it opens");
  add_columns(
      app, "--level", ColumnRole::level, run.columns,
      "Column of levels, high while the contact is closed; repeatable. Times are in --time");
  add_text(app, "--time", run.levels.time, "NAME",
           "Column of the levels' times [the one that begins with Time]");
  const auto set_threshold = [&run](const std::string& text) {
    const auto number = parse_decimal(text);
    if (!number)
      throw CLI::ValidationError("--threshold", text + " is not allowed; must be a finite number");
    run.levels.threshold = difference_in(*number, {}, {1, 0});
  };
  app.add_option_function<std::string>("--threshold", set_threshold,
                                       "A level above X is high [0.5, of levels 0 and 1]")
      ->type_name("X");
  add_flag(app, "--inverted", run.levels.inverted, "Low while the contact is closed");
  add_choice(app, "--impacts-at", run.levels.impacts,
             {{"rising", Edge::rising}, {"falling", Edge::falling}, {"both", Edge::both}},
             "Edges of the levels that are impacts: rising, falling or both; after "
             "--inverted, rising is where the level falls");
  const auto set_unit = [&run](const std::string& text) {
    const std::vector<std::string> choices{"s", "ms", "us", "ns", "a number of seconds > 0"};
    run.unit = parse_unit(text);
    if (!run.unit) throw CLI::ValidationError("--unit", choose(text, choices));
  };
  app.add_option_function<std::string>("--unit", set_unit,
                                       "Unit of the file's times: s, ms, us, ns or its length in "
                                       "seconds [as the columns' names say, else s]")
      ->type_name("U");
  const auto set_offset = [&run](const std::string& text) {
    const auto time = parse_clock_time(text, DecimalMark::point);
    if (!time)
      throw CLI::ValidationError("--offset",
                                 text + " is not allowed; must be a finite number or a time");
    run.import.offset = time->value;
  };
  app.add_option_function<std::string>(
         "--offset", set_offset,
         "Time that is the machine's t = 0, in the file's unit and on its clock [0]")
      ->type_name("T");
  add_positive(app, "--debounce", run.import.debounce, "T",
               "Merge closings of a contact that follow within T [s]");
  add_positive(app, "--pulse-shorter-than", run.import.pulse_shorter_than, "T",
               "Take contacts shorter than T [s] as pulses, at their closing");
  add_positive(app, "--duration", run.import.duration, "T",
               "Leave out events after this time [s]; a log ends there");
  const auto set_names = [&run](const std::string& text) {
    std::vector<std::string_view> names;
    split_fields(text, names);
    run.names.assign(names.begin(), names.end());
  };
  app.add_option_function<std::string>("--columns", set_names,
                                       "Names of the columns of a file without a header line")
      ->type_name("NAME,...");
  const auto set_separator = [&run](const std::string& text) {
    const std::vector<std::string> choices{"comma", "semicolon", "tab"};
    run.separator = parse_separator(text);
    if (!run.separator) throw CLI::ValidationError("--separator", choose(text, choices));
  };
  app.add_option_function<std::string>("--separator", set_separator,
                                       "comma, semicolon or tab, if the header does not show it")
      ->type_name("NAME");
}

}  // namespace sprag
