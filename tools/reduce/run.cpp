#include "tools/reduce/run.h"

#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>

#include "command_line/program.h"
#include "command_line/scene_inputs.h"
#include "recording/recorded_events.h"
#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/text/printable.h"
#include "sprag/detail/text/reduction_text.h"
#include "sprag/detail/text/table.h"
#include "tools/reduce/json.h"

namespace sprag {
namespace {

constexpr auto longest_trial = std::chrono::seconds(5);

void check_usage(const ReduceRun& run) {
  if (run.accuracy > 0.0) return;
  if (run.modes == 0) throw UsageError("--modes is required, or --accuracy");
  if (run.events.empty()) throw UsageError("EVENTS is required with --modes");
}

void write_reduced(const ReduceRun& run, const Scene& scene, const Reduction& reduction) {
  const Scene part = reduced_scene(scene, reduction.machine);
  write_scene(run.output, part, description(scene, reduction));
  const std::string file = run.output.string() + ": ";
  for (const std::string& remark : part.remarks) std::cerr << file << remark << '\n';
  if (part.prior.tolerance.any()) {
    std::cerr << file << "[tolerance] is copied: B does not cover the modes that are left out\n";
  }
}

// What the accuracy needs; as text and in `object`.
Accuracy needed(const ReduceRun& run, const Scene& scene, std::string& text,
                nlohmann::ordered_json& object) {
  TrialLimits limits;
  limits.out_of_time = [begin = std::chrono::steady_clock::now()] {
    return std::chrono::steady_clock::now() - begin > longest_trial;
  };
  Assessment assessment = assess(scene, limits);
  assess_accuracy(scene, run.accuracy, limits, assessment);
  const std::string& what = assessment.findings.back().what;
  if (!assessment.accuracy) throw ModelError(what);
  write_json(*assessment.accuracy, object);
  object["what"] = what;
  append_wrapped(text, printable(scene.name) + ": " + what);
  return std::move(*assessment.accuracy);
}

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
  check_usage(run);
  const Scene scene = load_scene(run.scene, common);
  if (!run.output.empty()) refuse_recorded_inputs(scene, "--output");
  std::optional<RecordedEvents> recorded;
  if (!run.events.empty()) {
    recorded =
        read_recorded_events(run.events, scene, run.duration, AfterLoss::dropped, common, report);
  }
  std::string text;
  nlohmann::ordered_json object{{"scene", scene.name}}, of_accuracy;
  int modes = run.modes;
  if (run.accuracy > 0.0) {
    const Accuracy accuracy = needed(run, scene, text, recorded ? of_accuracy : object);
    modes = accuracy.fewest.modes;
    if (!recorded) {
      print_result(object, text, run.json, report);
      if (!run.output.empty()) write_reduced(run, scene, accuracy.fewest);
      return exit_done;
    }
    text += "\nOf these modes with the recorded events:\n";
  }
  const ModalMachine machine = modal_machine(scene);
  const std::vector<Eigen::Index> kept = first_modes(machine, modes);
  const Followed followed = second_half(recorded->events, recorded->begins, recorded->closed);
  const ReductionTable table{scene.name, closings(followed), followed.counts,
                             followed.events.back().t, reductions(machine, kept, followed)};
  if (table.reductions.empty()) {
    throw ModelError("the first " + std::to_string(modes) + " modes do not see every contact");
  }
  write_json(table, object);
  if (!of_accuracy.is_null()) object["by_accuracy"] = of_accuracy;
  print_result(object, text + to_text(table), run.json, report);
  if (!run.output.empty()) write_reduced(run, scene, table.reductions.front());
  return recorded->whole ? exit_done : exit_failed;
}

}  // namespace sprag
