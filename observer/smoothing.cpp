#include "observer/smoothing.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "command_line/scene_inputs.h"
#include "observer/input_stream.h"
#include "recording/recorded_events.h"
#include "recording/recording.h"
#include "sprag/detail/files/confidence_columns.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/smoother.h"

namespace sprag {
namespace {

std::vector<std::string> smoothed_columns(const Model& model) {
  const Eigen::Index f = model.coordinates();
  std::vector<std::string> names;
  const auto add = [&](const std::string& name, Eigen::Index n) {
    for (Eigen::Index i = 1; i <= n; ++i) names.push_back(name + std::to_string(i));
  };
  add("sigma_q", f);
  add("sigma_u", f);
  add("sigma_g", std::ssize(model.contacts));
  names.emplace_back("smoothed");
  for (std::string& name : output_columns(model.outputs, true)) names.push_back(std::move(name));
  return names;
}

// The scene with the samples on SPRAG_INPUT of a log in place of its stream: those of the last
// session, as the events. With a CSV of events the scene's own record is used.
Scene with_logged_input(const Scene& scene, const std::filesystem::path& file,
                        const CommonOptions& common) {
  Scene recorded = scene;
  recorded.stream_duration = 0.0;
  InputFile log(file);
  if (!(scene.stream_duration > 0.0) || !is_lcm_log(log)) return recorded;
  const StreamedScene streamed(scene);
  InputHistory history(*streamed.input);
  std::int64_t session = 0;
  RecordedMessages messages(std::move(log), static_cast<int>(scene.model.contacts.size()),
                            scene.clock, key_of(common));
  messages.on_input([&](const InputMessage& message) {
    if (message.session != session) history.restart();
    session = message.session;
    history.take(message);
  });
  ContactMessage contacts;
  Arrival arrival;
  while (messages.next(contacts, arrival)) {
  }
  constexpr std::int64_t fewest = 4;
  const SampledInput& input = *streamed.input;
  if (std::ssize(input.knots()) < fewest || input.last() < 0.0) {
    throw UsageError("--smooth: " + file.string() + " has no samples of the excitation");
  }
  std::vector<double> values;
  for (std::size_t k = 0; k < input.knots().size(); ++k) values.push_back(input.at_knot(k)[2]);
  const auto record = std::make_shared<const SampledInput>(
      input.knots(), values,
      SampledInput::Settings{.outside = Outside::hold, .noise = input.noise()});
  for (Force& force : recorded.model.forces) {
    if (force.input) force.input = record;
  }
  if (recorded.frame && recorded.frame->input) recorded.frame->input = record;
  return recorded;
}

}  // namespace

int run_smoothing(const Scene& given, const ObserverOptions& options, const ReplayOptions& replay,
                  const CommonOptions& common, nlohmann::ordered_json& report) {
  const Scene scene = with_logged_input(given, replay.file, common);
  const Model& model = scene.model;
  const RecordedEvents recorded = read_recorded_events(replay.file, scene, options.duration,
                                                       AfterLoss::dropped, common, report);
  const std::string name = replay.file.string();
  if (!recorded.whole || !recorded.problems.empty() || recorded.begins > 0.0 ||
      recorded.closed != 0) {
    throw UsageError(
        "--smooth: " + name +
        " does not have every event since t = 0; the observer without --smooth accepts "
        "such a recording");
  }
  if (recorded.events.empty()) throw UsageError("--smooth: " + name + " has no events");
  const double end = std::isinf(options.duration) ? recorded.events.back().t : options.duration;
  report_held_inputs(scene, end);
  StatesWriter states(options.states, model.coordinates(), smoothed_columns(model));
  states.require_good();
  std::int64_t ticks = 0, smoothed_ticks = 0;
  std::vector<double> more;
  const auto write = [&](std::int64_t k, const SmoothedEstimate& estimate, bool smoothed) {
    more.clear();
    for (const Eigen::VectorXd* x : {&estimate.sigma_q, &estimate.sigma_u, &estimate.sigma_gap}) {
      more.insert(more.end(), x->begin(), x->end());
    }
    more.push_back(smoothed ? 1.0 : 0.0);
    add_outputs(model.outputs, estimate.q, estimate.u, estimate.sigma_outputs, more);
    states.write(k, tick_instant(k, options.tick).hi, estimate.q, estimate.u, more);
    ++ticks;
    smoothed_ticks += smoothed ? 1 : 0;
  };
  std::vector<SmoothedStretch> stretches;
  try {
    stretches = smooth(scene, recorded.events, options.tick, last_tick(end, options.tick), write);
  } catch (const SmoothingError& error) {
    throw UsageError(std::string("--smooth: ") + error.what());
  }
  report["ticks"] = ticks;
  report["smoothed_ticks"] = smoothed_ticks;
  for (const SmoothedStretch& stretch : stretches) {
    report["stretches"].push_back({{"from", stretch.from},
                                   {"to", stretch.to},
                                   {"events", stretch.events},
                                   {"misfit", stretch.misfit}});
  }
  std::cerr << "smoothed " << smoothed_ticks << " of " << ticks << " ticks\n";
  states.finish();
  return exit_done;
}

}  // namespace sprag
