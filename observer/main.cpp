// observer: estimates a machine's full state from the times at which its contacts close and open,
// live or from a recording. The real-time loop is RealTimeLoop::run() in real_time_loop.cpp.
#include <cmath>

#include "command_line/scene_inputs.h"
#include "observer/command.h"
#include "observer/live.h"
#include "observer/smoothing.h"
#include "sprag/scene.h"

int main(int argc, char** argv) {
  const auto app =
      sprag::command_line("Reconstructs a machine's state from its contact events.", "observer");
  sprag::CommonOptions common;
  common.runs_until_signal = true;
  sprag::ObserverCommand command;
  sprag::add_common_options(*app, common);
  sprag::add_observer_options(*app, common, command);

  return sprag::run_program(argc, argv, *app, common, [&](nlohmann::ordered_json& report) {
    sprag::Scene scene = sprag::load_scene(command.scene, common);
    if (command.confidence) scene.prior.confidence = *command.confidence;
    sprag::check(command);
    const double duration = command.options.duration;
    const bool streamed = scene.stream_duration > 0.0;
    if (!streamed && std::isfinite(duration)) {
      sprag::require_inputs_until(scene, duration, "--duration");
    } else if (!streamed && command.replay.file.empty()) {
      sprag::report_held_inputs(scene, duration);
    }
    if (command.smooth) {
      return sprag::run_smoothing(scene, command.options, command.replay, common, report);
    }
    if (command.replay.file.empty()) {
      return sprag::run_live(scene, command.options, common, report);
    }
    return sprag::run_replay(scene, command.options, command.replay, common, report);
  });
}
