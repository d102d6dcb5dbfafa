#include "tools/reduce/run.h"

#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "observer/recorded_events.h"
#include "sprag/analysis/reduction_choice.h"
#include "sprag/files/output_file.h"
#include "sprag/files/scene_file.h"
#include "sprag/files/scene_writer.h"
#include "tools/reduce/print.h"

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
  const Scene scene = read_scene(run.scene);
  const ModalMachine machine = modal_machine(scene);
  const std::vector<Eigen::Index> kept = first_modes(machine, run.modes);
  const RecordedEvents recorded = read_recorded_events(
      run.events, static_cast<int>(scene.model.contacts.size()), run.duration, key_of(common));
  for (const std::string& problem : recorded.problems) std::cerr << problem << '\n';
  report["problems"] = recorded.problems;

  const Followed followed = second_half(recorded.events, recorded.begins, recorded.closed);
  const ReductionTable table{scene.name, followed, reductions(machine, kept, followed)};
  if (table.reductions.empty()) {
    throw ModelError("the first " + std::to_string(run.modes) + " modes do not see every contact");
  }
  to_json(table, report);
  OutputFile out = OutputFile::standard_output();
  if (run.json) {
    using Json = nlohmann::ordered_json;
    Json object;
    to_json(table, object);
    out.write(object.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  } else {
    out.write(to_text(table));
  }
  if (!out.close()) throw std::runtime_error(out.error());
  if (!run.output.empty()) {
    const Reduction& best = table.reductions.front();
    write_scene(run.output, reduced_scene(scene, best.machine), description(scene, best));
  }
  return recorded.whole ? exit_done : exit_failed;
}

}  // namespace sprag
