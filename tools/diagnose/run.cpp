#include "tools/diagnose/run.h"

#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "observer/recorded_events.h"
#include "sprag/files/output_file.h"
#include "sprag/files/scene_file.h"
#include "tools/diagnose/diagnosis.h"
#include "tools/diagnose/print.h"

namespace sprag {

int run_diagnose(const DiagnoseRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report) {
  const Scene scene = read_scene(run.scene);
  const RecordedEvents recorded = read_recorded_events(
      run.log, static_cast<int>(scene.model.contacts.size()), run.duration, key_of(common));
  for (const std::string& problem : recorded.problems) std::cerr << problem << '\n';
  report["problems"] = recorded.problems;
  const Diagnosis diagnosis = diagnose(scene, recorded.events, run.jitter.value_or(scene.jitter),
                                       {recorded.begins, recorded.closed});
  to_json(diagnosis, report);
  OutputFile out = OutputFile::standard_output();
  if (run.json) {
    using Json = nlohmann::ordered_json;
    Json object;
    to_json(diagnosis, object);
    out.write(object.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  } else {
    out.write(to_text(diagnosis));
  }
  if (!out.close()) throw std::runtime_error(out.error());
  if (!recorded.whole) return exit_failed;
  return diagnosis.fits ? exit_done : exit_does_not_fit;
}

}  // namespace sprag
