// import_events: turns time stamps of contacts, as spreadsheets and loggers export them, into what
// observer --replay reads. import.h says what is measured.
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "lcmtypes/program.h"
#include "mechanics/scene.h"
#include "tools/import_events/run.h"

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
  // At once, one by one: contacts are counted in the order given, across the three options.
  app.add_option_function<std::string>(name, add, help)
      ->trigger_on_parse()
      ->type_name("[CONTACT=]NAME");
}

void add_decimal(CLI::App& app, const std::string& name, sprag::Decimal& value,
                 std::optional<sprag::Decimal> (*parse)(std::string_view),
                 const std::string& allowed, const std::string& type, const std::string& help) {
  const auto store = [&value, name, parse, allowed](const std::string& text) {
    const auto number = parse(text);
    if (!number) throw CLI::ValidationError(name, text + " is not allowed; must be " + allowed);
    value = *number;
  };
  app.add_option_function<std::string>(name, store, help)->type_name(type);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(description, "import_events");
  sprag::CommonOptions common;
  sprag::ImportRun run;
  std::filesystem::path scene;
  sprag::add_common_options(app, common);
  sprag::add_file(app, common, "FILE", sprag::NamedFile::Use::read, run.file, "",
                  "File with a header line and columns of times")
      ->required();
  sprag::add_scene(app, common, scene);
  add_columns(app, "--impacts", sprag::ColumnRole::impacts, run.columns,
              "Column of impact times; repeatable");
  add_columns(app, "--on", sprag::ColumnRole::on, run.columns,
              "Column of times at which a contact closes; repeatable, each with an --off");
  add_columns(app, "--off", sprag::ColumnRole::off, run.columns,
              "Column of times at which it opens");
  add_decimal(app, "--unit", run.import.unit, sprag::parse_unit,
              "s, ms, us, ns or a number > 0, in seconds", "U",
              "Unit of the file's times: s, ms, us, ns or its length in seconds [s]");
  add_decimal(
      app, "--offset", run.import.offset,
      [](std::string_view text) { return sprag::parse_decimal(text); }, "a finite number", "T",
      "Time that is the machine's t = 0, in the file's unit and on its clock [0]");
  sprag::add_positive(app, "--debounce", run.import.debounce, "T",
                      "Merge closings of a contact that follow within T [s]");
  sprag::add_positive(app, "--pulse-shorter-than", run.import.pulse_shorter_than, "T",
                      "Take contacts shorter than T [s] as pulses, at their closing");
  sprag::add_positive(app, "--duration", run.import.duration, "T",
                      "Leave out events after this time [s]; a log ends there");
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
    const auto contacts = sprag::read_scene(scene).model.contacts.size();
    return sprag::run_import(run, static_cast<int>(contacts), common, report);
  });
}
