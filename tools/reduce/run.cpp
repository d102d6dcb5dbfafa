#include "tools/reduce/run.h"

#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "command_line/scene_inputs.h"
#include "recording/recorded_events.h"
#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/text/reduction_text.h"
#include "tools/reduce/json.h"

namespace sprag {
namespace {

std::vector<Eigen::Index> first_modes(const ModalMachine& machine, int n) {
  std::vector<Eigen::Index> kept = by_frequency(machine);
  if (n > static_cast<int>(kept.size())) {
    throw UsageError("--modes is " + std::to_string(n) + "; the scene has " +
                     std::to_string(kept.size()));
  }
  kept.resize(static_cast<std::size_t>(n));
  return kept;
}

}  // namespace

int run_reduce(const ReduceRun& run, const CommonOptions& common, nlohmann::ordered_json& report) {
  const Scene scene = load_scene(run.scene, common);
  if (!run.output.empty()) refuse_recorded_inputs(scene, "--output");
  const ModalMachine machine = modal_machine(scene);
  const std::vector<Eigen::Index> kept = first_modes(machine, run.modes);
  const RecordedEvents recorded =
      read_recorded_events(run.events, scene, run.duration, AfterLoss::dropped, common, report);

  const Followed followed = second_half(recorded.events, recorded.begins, recorded.closed);
  const ReductionTable table{scene.name, closings(followed), followed.counts,
                             followed.events.back().t, reductions(machine, kept, followed)};
  if (table.reductions.empty()) {
    throw ModelError("the first " + std::to_string(run.modes) + " modes do not see every contact");
  }
  nlohmann::ordered_json object;
  write_json(table, object);
  print_result(object, to_text(table), run.json, report);
  if (!run.output.empty()) {
    const Reduction& best = table.reductions.front();
    write_scene(run.output, reduced_scene(scene, best.machine), description(scene, best));
  }
  return recorded.whole ? exit_done : exit_failed;
}

}  // namespace sprag
