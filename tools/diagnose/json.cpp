#include "tools/diagnose/json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "sprag/detail/text/diagnosis_text.h"

namespace sprag {

void write_json(const Diagnosis& diagnosis, nlohmann::ordered_json& object) {
  object["scene"] = diagnosis.scene;
  object["verdict"] = verdict(diagnosis);
  object["fits"] = diagnosis.fits;
  object["closings"] = diagnosis.closings;
  object["from"] = diagnosis.from;
  object["to"] = diagnosis.to;
  object["jitter"] = diagnosis.jitter;
  object["unsure_impacts"] = diagnosis.unsure;
  object["misfit"] = diagnosis.misfit;
  object["largest_misfit"] = diagnosis.largest_misfit;
  object["scatter"] = diagnosis.scatter;
  object["common_scatter"] = diagnosis.common_scatter;
  object["misfit_before"] = diagnosis.misfit_before;
  const Candidate* best = diagnosis.explanation();
  object["explanation"] = nullptr;
  if (best != nullptr) object["explanation"] = best->parameter.key;
  object["missing"] = nlohmann::ordered_json::array();
  for (const MissingImpact& impact : diagnosis.missing) {
    object["missing"].push_back({{"t", impact.t}, {"contact", impact.contact + 1}});
  }
  object["spurious"] = nlohmann::ordered_json::array();
  for (const ContactEvent& event : diagnosis.spurious) {
    object["spurious"].push_back({{"t", event.t}, {"contact", event.contact + 1}});
  }
  object["ties"] = nlohmann::ordered_json::array();
  for (const Candidate* tie : diagnosis.ties()) object["ties"].push_back(tie->parameter.key);
  object["parameters"] = nlohmann::ordered_json::array();
  for (const Candidate& candidate : diagnosis.candidates) {
    const Unknown& parameter = candidate.parameter;
    nlohmann::ordered_json entry{{"parameter", parameter.key}, {"unit", parameter.unit}};
    entry["nominal"] = parameter.nominal;
    entry["told"] = candidate.determined;
    if (candidate.determined) {
      entry["value"] = candidate.value;
      entry["deviation"] = candidate.deviation;
      entry["change"] = candidate.change();
      if (parameter.is_relative()) {
        entry["change_percent"] = 100.0 * candidate.change() / std::abs(parameter.nominal);
      }
      entry["scatter"] = candidate.scatter;
      entry["misfit_after"] = candidate.misfit;
      entry["gain"] = candidate.gain;
      entry["explained"] = candidate.explained;
      entry["improved_by"] = candidate.improved_by;
      entry["sensitivity"] = candidate.sensitivity;
    }
    object["parameters"].push_back(std::move(entry));
  }
  const Candidate* phase = diagnosis.phase();
  if (phase != nullptr && phase->determined && diagnosis.only_frequency > 0.0) {
    object["clock_offset_instead_of_phase"] = -phase->change() / diagnosis.only_frequency;
  }
}

}  // namespace sprag
