#include "tools/import_events/options.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string_view>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/import/clock_time.h"
#include "sprag/detail/import/unit.h"

namespace sprag {

void add_level_columns(CLI::App& app, std::vector<ColumnOption>& columns) {
  const auto add = [&columns](const std::string& text) {
    columns.push_back({ColumnRole::level, text});
  };
  // Called for each option in turn, since contacts are numbered in the order of the options.
  app.add_option_function<std::string>(
         "--level", add,
         "Column of levels, high while the contact is closed; repeatable. Times are in --time")
      ->trigger_on_parse()
      ->type_name("[CONTACT=]NAME");
}

void add_level_options(CLI::App& app, LevelOptions& levels) {
  add_text(app, "--time", levels.time, "NAME",
           "Column of the levels' times [the one that begins with Time]");
  const auto set_threshold = [&levels](const std::string& text) {
    const auto number = parse_decimal(text);
    if (!number)
      throw CLI::ValidationError("--threshold", text + " is not allowed; must be a finite number");
    levels.threshold = difference_in(*number, {}, {1, 0});
  };
  app.add_option_function<std::string>("--threshold", set_threshold,
                                       "A level above X is high [0.5, of levels 0 and 1]")
      ->type_name("X");
  add_flag(app, "--inverted", levels.inverted, "Low while the contact is closed");
  add_choice(app, "--impacts-at", levels.impacts,
             {{"rising", Edge::rising}, {"falling", Edge::falling}, {"both", Edge::both}},
             "Edges of the levels that are impacts: rising, falling or both; after "
             "--inverted, rising is where the level falls");
}

void add_time_options(CLI::App& app, std::optional<Decimal>& unit, Decimal& offset, double& rate) {
  const auto set_unit = [&unit](const std::string& text) {
    const std::vector<std::string> choices{"s", "ms", "us", "ns", "a number of seconds > 0"};
    unit = parse_unit(text);
    if (!unit) throw CLI::ValidationError("--unit", choose(text, choices));
  };
  app.add_option_function<std::string>("--unit", set_unit,
                                       "Unit of the times: s, ms, us, ns or its length in "
                                       "seconds [as the columns' names say, else s]")
      ->type_name("U");
  const auto set_offset = [&offset](const std::string& text) {
    const auto time = parse_clock_time(text, DecimalMark::point);
    if (!time)
      throw CLI::ValidationError("--offset",
                                 text + " is not allowed; must be a finite number or a time");
    offset = time->value;
  };
  app.add_option_function<std::string>(
         "--offset", set_offset,
         "Time that is the machine's t = 0, in the unit and on the clock of the times [0]")
      ->type_name("T");
  add_positive(app, "--rate", rate, "R",
               "Seconds of the clock of the times per second of the machine: 1.0002 for a clock "
               "that is 200 ppm fast [1]");
}

void check_clock(const ContactClock& clock, double rate, const Decimal& offset) {
  if (rate != 1.0 && clock.rate != 1.0) {
    throw UsageError(
        "--rate and clock.rate of the scene would correct the same clock twice; leave one of them "
        "out");
  }
  if (offset.mantissa != 0 && clock.offset != 0.0) {
    std::cerr << "clock.offset of the scene counts in addition to --offset\n";
  }
}

void add_format_options(CLI::App& app, std::vector<std::string>& names,
                        std::optional<char>& separator) {
  const auto set_names = [&names](const std::string& text) {
    std::vector<std::string_view> fields;
    split_fields(text, fields);
    names.assign(fields.begin(), fields.end());
  };
  app.add_option_function<std::string>("--columns", set_names,
                                       "Names of the columns of lines without a header line")
      ->type_name("NAME,...");
  const auto set_separator = [&separator](const std::string& text) {
    const std::vector<std::string> choices{"comma", "semicolon", "tab"};
    separator = parse_separator(text);
    if (!separator) throw CLI::ValidationError("--separator", choose(text, choices));
  };
  app.add_option_function<std::string>("--separator", set_separator,
                                       "comma, semicolon or tab, if the lines do not show it")
      ->type_name("NAME");
}

void add_edge_rules(CLI::App& app, double& debounce, double& pulse_shorter_than) {
  add_positive(app, "--debounce", debounce, "T",
               "Merge closings of a contact that follow within T [s]");
  add_positive(app, "--pulse-shorter-than", pulse_shorter_than, "T",
               "Take contacts shorter than T [s] as pulses, at their closing");
}

}  // namespace sprag
