#include "tools/identify/run.h"

#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "command_line/program.h"
#include "observer/recorded_events.h"
#include "sprag/files/output_file.h"
#include "tools/identify/fitted_text.h"
#include "tools/identify/print.h"

namespace sprag {
namespace {

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_scene(const IdentifyRun& run, const std::string& text, const Scene& scene,
                 Identification fit, const DriftEstimate* drift, double begins) {
  if (drift != nullptr) {
    fit.fitted.drift = drift->drift;
    fit.jitter = drift->jitter;
  }
  OutputFile out(run.output);
  out.write(fitted_text(text, scene, fit, begins, run.scene, run.output));
  if (!out.close()) throw std::runtime_error(out.error());
  if (fit.start_t != begins) {
    std::cerr << "the fit begins at t = " << fit.start_t << ", so that the start in "
              << run.output.string() << " is the one it was\n";
  }
}

}  // namespace

int run_identify(const IdentifyRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report) {
  const Scene scene = load_scene(run.scene, common);
  const std::string text = run.output.empty() ? std::string() : text_of(run.scene);
  if (!run.output.empty() && text.empty()) {
    throw UsageError("--output needs a scene file that can be read again, not a pipe");
  }
  IdentificationSettings settings;
  settings.unknowns = sought(scene, run.sought);
  const RecordedEvents recorded =
      read_recorded_events(run.log, static_cast<int>(scene.model.contacts.size()), run.duration,
                           BehindLoss::used, common, report);
  settings.gaps = recorded.gaps;
  settings.begins = recorded.begins;
  settings.closed = recorded.closed;
  if (run.jitter) {
    settings.jitter = run.jitter;
  } else if (scene.jitter > 0.0) {
    settings.jitter = scene.jitter;
  }
  IdentifyResult result;
  result.scene = scene.name;
  result.events = recorded.events;
  result.held = held_for_scale(scene, settings.unknowns);
  result.fit = identify(scene, recorded.events, settings);
  // Judged by the jitter that is told, else by what the fit of all leaves.
  if (run.sought.free.empty() && (result.fit.fits() || settings.jitter)) {
    IdentificationSettings of_causes = settings;
    of_causes.unknowns = single_causes(scene, settings.unknowns);
    result.causes = explain(scene, recorded.events, of_causes, result.fit.jitter);
    result.asked_for_causes = true;
  }
  result.drift = estimate_drift(scene, result.fit);
  result.trend = estimate_restitution_trend(scene, result.fit);
  const bool effective =
      run.accept && (result.fit.problem == FitProblem::misfit ||
                     (result.fit.problem == FitProblem::unpredictable && drifts(result)));
  if (effective) {
    result.accepted = true;
    result.fit.jitter = result.fit.scatter;
    result.fit.fitted.jitter = result.fit.scatter;
  }
  nlohmann::ordered_json object;
  to_json(result, object);
  print_result(object, to_text(result), run.json, report);
  const bool good = result.fit.fits() || effective;
  if (good && !run.output.empty()) {
    write_scene(run, text, scene, result.fit, drifts(result) ? &*result.drift : nullptr,
                recorded.begins);
  }
  if (!recorded.whole) return exit_failed;
  return good ? exit_done : exit_not_identified;
}

}  // namespace sprag
