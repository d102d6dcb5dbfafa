#include "tools/identify/run.h"

#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "command_line/program.h"
#include "command_line/scene_inputs.h"
#include "recording/recorded_events.h"
#include "sprag/detail/files/output_file.h"
#include "sprag/detail/identification/fitted_parameters.h"
#include "sprag/detail/text/identification_text.h"
#include "sprag/detail/text/printable.h"
#include "tools/identify/each.h"
#include "tools/identify/fitted_text.h"
#include "tools/identify/json.h"
#include "tools/identify/mended_events.h"

namespace sprag {
namespace {

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_scene(const IdentifyRun& run, const std::string& text, const Scene& scene,
                 const Identification& fit) {
  write_file(run.output, fitted_text(text, scene, fit, run.scene, run.output));
  for (const std::string& key : not_filtered(fit)) {
    std::cerr << key << " is not listed in [parameters] of " << run.output.string()
              << ": a filter cannot follow the contact clock\n";
  }
  if (fit.start_t != fit.begins) {
    std::cerr << "the fit begins at t = " << fit.start_t << ": the start in " << run.output.string()
              << " is left as it was\n";
  }
}

void note_unwritten(const std::filesystem::path& file, const std::string& why) {
  std::cerr << printable(file.string()) << " is not written: " << why << '\n';
}

}  // namespace

int run_identify(const IdentifyRun& run, const CommonOptions& common,
                 nlohmann::ordered_json& report) {
  if (run.log.extension() == ".toml" || run.scene.extension() == ".csv") {
    throw UsageError("the order is LOG SCENE, the events before the scene; LOG is " +
                     run.log.string() + " and SCENE is " + run.scene.string());
  }
  const Scene scene = load_scene(run.scene, common);
  const std::string text = run.output.empty() ? std::string() : text_of(run.scene);
  if (!run.output.empty() && text.empty()) {
    throw UsageError("--output needs a scene file that can be read again, not a pipe");
  }
  if (run.each) return run_each(run, scene, common, report);
  IdentifyRequest request = request_of(scene, run.sought);
  request.jitter = run.jitter;
  request.accept = run.accept;
  const RecordedEvents recorded =
      read_recorded_events(run.log, scene, run.duration, AfterLoss::used, common, report);
  if (!recorded.events.empty()) {
    require_inputs_until(scene, recorded.events.back().t, "--duration");
  }
  IdentificationSettings settings;
  settings.gaps = recorded.gaps;
  settings.begins = recorded.begins;
  settings.closed = recorded.closed;
  settings.progress = progress_on_stderr();
  IdentifyResult result = identify_requested(scene, recorded.events, request, settings);
  const Departure& departure = result.fit.departure;
  if (run.no_drift_limit && !departure.is_drift() && !departure.is_scatter()) {
    result.fit.fitted.prior.drift = scene.prior.drift;
  }
  nlohmann::ordered_json object;
  write_json(result, object);
  print_result(object, to_text(result), run.json, report);
  const bool good = result.fit.fits() || result.accepted;
  if (!run.events.empty()) {
    if (result.fit.converged()) {
      write_mended(run.events, recorded.events, scene.clock, result.fit);
    } else {
      note_unwritten(run.events, "no optimum was found");
    }
  }
  if (!run.output.empty()) {
    if (good) {
      write_scene(run, text, scene, result.fit);
    } else {
      note_unwritten(run.output,
                     run.accept ? "--accept takes a wrong model, not values that are not unique"
                                : "the events do not fit");
    }
  }
  if (!recorded.whole) return exit_failed;
  return good ? exit_done : exit_not_identified;
}

}  // namespace sprag
