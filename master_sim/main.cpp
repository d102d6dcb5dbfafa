// master_sim: simulates an impacting machine and publishes its contact events. The main loop is
// MasterProcess::run() in master_process.cpp.
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "master_sim/machine_json.h"
#include "master_sim/master_process.h"
#include "sprag/scene.h"

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Simulates a scene's machine and publishes its contact events.", "master_sim");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  sprag::MasterOptions options;
  std::filesystem::path file;
  sprag::add_common_options(*app, common);
  sprag::add_scene(*app, common, file);
  sprag::add_positive(*app, "--duration", options.duration, "T", "Stop at this simulated time");
  sprag::add_positive_or_max(*app, "--speed", options.speed, "R",
                             "Simulated s per wall s, or max: as fast as it goes [1]");
  sprag::add_positive(*app, "--tick", options.tick, "h",
                      "Tick of the states, simulated time [1e-3]");
  sprag::add_file(*app, common, "--events", sprag::NamedFile::Use::written, options.events, "F.csv",
                  "Write the contact events here");
  sprag::add_file(*app, common, "--states", sprag::NamedFile::Use::written, options.states, "F.csv",
                  "Write the state at every tick here");
  sprag::add_flag(*app, "!--no-lcm", options.lcm, "Publish nothing");
  sprag::add_flag(*app, "!--no-truth", options.truth, "Do not publish the true state");
  sprag::add_flag(*app, "--publish-input", options.publish_input,
                  "Publish the record of the excitation, for observers of a streamed one");
  bool machine = false;
  sprag::add_flag(*app, "--machine", machine,
                  "Simulate nothing: print contacts and outputs of the machine as one JSON object");

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    const sprag::Scene scene = sprag::load_scene(file, common);
    if (!machine) return sprag::run_master(scene, options, common, report);
    nlohmann::ordered_json object;
    sprag::write_machine(scene, object);
    sprag::print_result(object, "", true, report);
    return sprag::exit_done;
  });
}
