#include "master_sim/machine_json.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

void write_machine(const Scene& scene, nlohmann::ordered_json& object) {
  const Model& model = scene.model;
  object["scene"] = scene.name;
  object["coordinates"] = model.coordinates();
  const double alpha = model.C.trace() / model.M.trace();
  const bool proportional = model.C.isApprox(alpha * model.M, 1e-12);
  object["decay_rate"] = alpha > 0.0 && proportional ? nlohmann::ordered_json(alpha) : nullptr;
  object["contacts"] = nlohmann::ordered_json::array();
  for (const Contact& contact : model.contacts) {
    object["contacts"].push_back(
        {{"w", std::vector<double>(contact.w.begin(), contact.w.end())},
         {"clearance", contact.clearance},
         {"motion",
          {{"amplitude", contact.motion.amplitude},
           {"frequency", contact.motion.frequency},
           {"phase", contact.motion.phase}}},
         {"recorded_motion", contact.input != nullptr && contact.input_share != 0.0}});
  }
  object["outputs"] = nlohmann::ordered_json::array();
  for (const Output& output : model.outputs) {
    object["outputs"].push_back({{"name", output.name}, {"unit", output.unit}});
  }
}

}  // namespace sprag
