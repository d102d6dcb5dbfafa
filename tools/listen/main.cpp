// listen: publishes the contact events of a device that prints edges, live.
#include "command_line/program.h"
#include "sprag/scene.h"
#include "tools/listen/options.h"
#include "tools/listen/run.h"

namespace {

constexpr const char* description =
    "Publishes contact events of a device that prints edges, for observers.\n"
    "Lines have a time, a contact (from 1) and its level, 1 while it is closed: "
    "time,contact,level. "
    "A header line or --columns names other columns, and --level columns of levels, one for each "
    "contact. They come from stdin, --serial or --tcp. Bounces and pulses are as in "
    "import_events. A line that cannot be used is named on stderr and skipped. A device that "
    "restarts begins a new session.";

}  // namespace

int main(int argc, char** argv) {
  const auto app = sprag::command_line(description, "listen");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  sprag::ListenRun run;
  std::filesystem::path scene;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, scene);
  sprag::add_listen_options(*app, common, run);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene machine = sprag::load_scene(scene, common);
    sprag::check_clock(machine.clock, run.intake.clock);
    return sprag::run_listen(run, machine, common, report);
  });
}
