// import_events: converts time stamps of contacts, as exported by spreadsheets and loggers, to the
// input of observer --replay. The rules are in import.h.
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"
#include "sprag/scene.h"
#include "tools/import_events/clock_time.h"
#include "tools/import_events/run.h"
#include "tools/import_events/unit.h"

namespace {

constexpr const char* description =
    "Turns columns of time stamps (CSV, TSV) into contact events for observer --replay.\n"
    "Impacts are pulses. A contact with a closing (--on) and an opening (--off) is a pulse if it "
    "is "
    "shorter than --pulse-shorter-than, from its closing to its opening, else it is sustained. "
    "--debounce comes first: closings that follow within this time after the last opening "
    "(impacts: "
    "after the last impact) are bounces of the same contact, which closes at its first closing and "
    "opens at its last opening. Times are t = (value - offset) * unit. Rows that cannot be used "
    "are "
    "named on stderr and left out.";

void add_columns(CLI::App& app, const std::string& name, sprag::ColumnRole role,
                 std::vector<sprag::ColumnOption>& columns, const std::string& help) {
  const auto add = [&columns, role](const std::string& text) { columns.push_back({role, text}); };
  // Called for each option in turn, since contacts are numbered in the order of all these options.
  app.add_option_function<std::string>(name, add, help)
      ->trigger_on_parse()
      ->type_name("[CONTACT=]NAME");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(description, "import_events");
  sprag::CommonOptions common;
  sprag::ImportRun run;
  std::filesystem::path scene;
  sprag::add_common_options(app, common);
  sprag::add_file(app, common, "FILE", sprag::NamedFile::Use::read, run.file, "",
                  "File with columns of times, and a header line with their names");
  sprag::add_scene(app, common, scene);
  add_columns(app, "--impacts", sprag::ColumnRole::impacts, run.columns,
              "Column of impact times; repeatable");
  add_columns(app, "--on", sprag::ColumnRole::on, run.columns,
              "Column of times at which a contact closes; repeatable, each with an --off");
  add_columns(app, "--off", sprag::ColumnRole::off, run.columns,
              "Column of times at which it opens");
  add_columns(
      app, "--level", sprag::ColumnRole::level, run.columns,
      "Column of levels, high while the contact is closed; repeatable. Times are in --time");
  sprag::add_text(app, "--time", run.levels.time, "NAME",
                  "Column of the levels' times [the one that begins with Time]");
  const auto set_threshold = [&run](const std::string& text) {
    const auto number = sprag::parse_decimal(text);
    if (!number)
      throw CLI::ValidationError("--threshold", text + " is not allowed; must be a finite number");
    run.levels.threshold = sprag::difference_in(*number, {}, {1, 0});
  };
  app.add_option_function<std::string>("--threshold", set_threshold,
                                       "A level above X is high [0.5, of levels 0 and 1]")
      ->type_name("X");
  sprag::add_flag(app, "--inverted", run.levels.inverted, "Low while the contact is closed");
  sprag::add_choice(app, "--impacts-at", run.levels.impacts,
                    {{"rising", sprag::Edge::rising},
                     {"falling", sprag::Edge::falling},
                     {"both", sprag::Edge::both}},
                    "Edges of the levels that are impacts: rising, falling or both; after "
                    "--inverted, rising is where the level falls");
  const auto set_unit = [&run](const std::string& text) {
    const std::vector<std::string> choices{"s", "ms", "us", "ns", "a number of seconds > 0"};
    run.unit = sprag::parse_unit(text);
    if (!run.unit) throw CLI::ValidationError("--unit", sprag::choose(text, choices));
  };
  app.add_option_function<std::string>("--unit", set_unit,
                                       "Unit of the file's times: s, ms, us, ns or its length in "
                                       "seconds [as the columns' names say, else s]")
      ->type_name("U");
  const auto set_offset = [&run](const std::string& text) {
    const auto time = sprag::parse_clock_time(text, sprag::DecimalMark::point);
    if (!time)
      throw CLI::ValidationError("--offset",
                                 text + " is not allowed; must be a finite number or a time");
    run.import.offset = time->value;
  };
  app.add_option_function<std::string>(
         "--offset", set_offset,
         "Time that is the machine's t = 0, in the file's unit and on its clock [0]")
      ->type_name("T");
  sprag::add_positive(app, "--debounce", run.import.debounce, "T",
                      "Merge closings of a contact that follow within T [s]");
  sprag::add_positive(app, "--pulse-shorter-than", run.import.pulse_shorter_than, "T",
                      "Take contacts shorter than T [s] as pulses, at their closing");
  sprag::add_positive(app, "--duration", run.import.duration, "T",
                      "Leave out events after this time [s]; a log ends there");
  const auto set_names = [&run](const std::string& text) {
    std::vector<std::string_view> names;
    sprag::split_fields(text, names);
    run.names.assign(names.begin(), names.end());
  };
  app.add_option_function<std::string>("--columns", set_names,
                                       "Names of the columns of a file without a header line")
      ->type_name("NAME,...");
  const auto set_separator = [&run](const std::string& text) {
    const std::vector<std::string> choices{"comma", "semicolon", "tab"};
    run.separator = sprag::parse_separator(text);
    if (!run.separator) throw CLI::ValidationError("--separator", sprag::choose(text, choices));
  };
  app.add_option_function<std::string>("--separator", set_separator,
                                       "comma, semicolon or tab, if the header does not show it")
      ->type_name("NAME");
  sprag::add_file(app, common, "--output", sprag::NamedFile::Use::written, run.output,
                  "F.csv|F.lcmlog", "Write an events CSV or an LCM log here, not to stdout");

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const auto contacts = sprag::load_scene(scene, common).model.contacts.size();
    return sprag::run_import(run, static_cast<int>(contacts), common, report);
  });
}
