// import_events: converts time stamps of contacts, as exported by spreadsheets and loggers, to the
// input of observer --replay. The rules are in import.h.
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "sprag/scene.h"
#include "tools/import_events/options.h"
#include "tools/import_events/run.h"

namespace {

constexpr const char* description =
    "Turns columns of time stamps (CSV, TSV) into contact events for observer --replay.\n"
    "Impacts are pulses. A contact with a closing (--on) and an opening (--off) is a pulse if it "
    "is shorter than --pulse-shorter-than, from its closing to its opening, else it is sustained. "
    "--debounce comes first: closings that follow within this time after the last opening "
    "(impacts: after the last impact) are bounces of the same contact, which closes at its first "
    "closing and opens at its last opening. Times are t = (value - offset) * unit / rate. Rows "
    "that "
    "cannot be used are named on stderr and left out.";

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
  sprag::add_import_options(app, run);
  sprag::add_file(app, common, "--output", sprag::NamedFile::Use::written, run.output,
                  "F.csv|F.lcmlog", "Write an events CSV or an LCM log here, not to stdout");

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene machine = sprag::load_scene(scene, common);
    sprag::check_clock(machine.clock, run.import.rate, run.import.offset);
    return sprag::run_import(run, static_cast<int>(machine.model.contacts.size()), common, report);
  });
}
