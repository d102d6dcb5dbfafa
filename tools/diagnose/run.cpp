#include "tools/diagnose/run.h"

#include <nlohmann/json.hpp>

#include "command_line/program.h"
#include "recording/recorded_events.h"
#include "sprag/detail/analysis/diagnosis.h"
#include "sprag/detail/text/diagnosis_text.h"
#include "tools/diagnose/json.h"

namespace sprag {

int run_diagnose(const DiagnoseRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report) {
  const Scene scene = load_scene(run.scene, common);
  const RecordedEvents recorded =
      read_recorded_events(run.log, scene, run.duration, AfterLoss::dropped, common, report);
  const Diagnosis diagnosis =
      diagnose(scene, recorded.events, run.jitter.value_or(scene.prior.jitter),
               {recorded.begins, recorded.closed});
  nlohmann::ordered_json object;
  write_json(diagnosis, object);
  print_result(object, to_text(diagnosis), run.json, report);
  if (!recorded.whole) return exit_failed;
  return diagnosis.fits ? exit_done : exit_does_not_fit;
}

}  // namespace sprag
