#include "tools/reduce/json.h"

#include <nlohmann/json.hpp>

namespace sprag {

void write_json(const ReductionTable& table, nlohmann::ordered_json& object) {
  const Reduction& best = table.reductions.front();
  object["scene"] = table.scene;
  object["modes"] = best.modes;
  object["correction"] = best.correction;
  object["coordinates"] = best.machine.model.coordinates();
  object["rms_gap"] = best.rms;
  object["closings"] = table.closings;
  object["from"] = table.from;
  object["to"] = table.to;
  object["candidates"] = nlohmann::ordered_json::array();
  for (const Reduction& reduction : table.reductions) {
    nlohmann::ordered_json entry{{"correction", reduction.correction},
                                 {"coordinates", reduction.machine.model.coordinates()},
                                 {"rms_gap", reduction.rms}};
    if (reduction.share) entry["share"] = *reduction.share;
    if (!reduction.static_vectors.empty()) {
      entry["static_vectors"] = reduction.static_vectors;
      entry["least_damping_ratio"] = reduction.least_zeta;
    }
    object["candidates"].push_back(std::move(entry));
  }
}

void write_json(const Accuracy& accuracy, nlohmann::ordered_json& object) {
  object["tolerance"] = accuracy.tolerance;
  object["duration"] = accuracy.duration;
  object["modes"] = accuracy.modes;
  object["changes"] = nlohmann::ordered_json::array();
  for (const Accuracy::Change& change : accuracy.changes) {
    object["changes"].push_back({{"modes", change.modes}, {"change", change.change}});
  }
  const Reduction& fewest = accuracy.fewest;
  object["corrected"] = {{"coordinates", accuracy.coordinates()},
                         {"modes", fewest.modes},
                         {"correction", fewest.correction},
                         {"change", accuracy.change}};
  if (fewest.share) object["corrected"]["share"] = *fewest.share;
}

}  // namespace sprag
