#include "tools/identify/each.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "recording/recorded_events.h"
#include "sprag/detail/analysis/diagnosis.h"
#include "sprag/detail/text/diagnosis_text.h"

namespace sprag {
namespace {

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
    const Parameter& parameter = candidate.parameter;
    nlohmann::ordered_json entry{{"parameter", parameter.key}, {"unit", parameter.unit}};
    entry["nominal"] = parameter.nominal;
    entry["told"] = candidate.determined;
    if (candidate.determined) {
      entry["value"] = candidate.value;
      entry["deviation"] = candidate.deviation;
      entry["change"] = candidate.change();
      if (parameter.relative) {
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

}  // namespace

int run_each(const IdentifyRun& run, const Scene& scene, const CommonOptions& common,
             nlohmann::ordered_json& report) {
  DiagnosisSettings settings;
  settings.jitter = run.jitter.value_or(scene.prior.jitter);
  settings.keys = request_of(scene, run.sought).free.value_or(std::vector<std::string>());
  settings.progress = progress_on_stderr();
  const RecordedEvents recorded =
      read_recorded_events(run.log, scene, run.duration, AfterLoss::dropped, common, report);
  settings.begins = recorded.begins;
  settings.closed = recorded.closed;
  const Diagnosis diagnosis = diagnose(scene, recorded.events, settings);
  nlohmann::ordered_json object;
  write_json(diagnosis, object);
  print_result(object, to_text(diagnosis), run.json, report);
  if (!recorded.whole) return exit_failed;
  return diagnosis.fits ? exit_done : exit_not_identified;
}

}  // namespace sprag
