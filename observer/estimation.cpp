#include "observer/estimation.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "command_line/program.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/replica/penetration.h"
#include "sprag/detail/text/printable.h"

namespace sprag {

namespace {

// Throws UsageError for options that a streamed excitation excludes.
const Scene& checked(const Scene& scene, const ObserverOptions& options) {
  if (!(scene.stream_duration > 0.0)) return scene;
  const auto refuse = [](const std::string& option, const char* why) {
    throw UsageError(option + " does not support a streamed excitation (the key `stream`): " + why);
  };
  if (options.estimator == EstimatorKind::adaptive) {
    refuse("--estimator adaptive", "identification needs the whole record");
  }
  const std::vector<std::string>& keys = scene.prior.parameters.keys;
  if (std::find(keys.begin(), keys.end(), "excitation.delay") != keys.end()) {
    // An earlier input would need samples that have not arrived.
    refuse("[parameters] excitation.delay", "identify finds it in a log");
  }
  if (options.predict > 0.0) refuse("--predict", "its future is unknown");
  if (std::isfinite(options.duration) && options.duration > scene.stream_duration) {
    throw UsageError("--duration is longer than excitation.stream_duration of " +
                     printable(scene.name) + "; must be shorter, or the key must be larger");
  }
  return scene;
}

}  // namespace

Estimation::Estimation(const Scene& given, const ObserverOptions& options, std::int64_t history)
    : of(checked(given, options)),
      supports(of.scene.model.contacts),
      length(length_scale(of.scene.model, of.scene.prior.start)),
      contacts(static_cast<int>(of.scene.model.contacts.size())),
      coordinates(of.scene.model.coordinates()),
      initial_bound(options.estimator == EstimatorKind::adaptive ? infinity
                                                                 : sprag::initial_bound(of.scene)),
      estimator(of.scene, options.tick, options.estimator),
      time_line(estimator, contacts, of.scene.prior.start, history),
      stream(of.input ? std::make_unique<InputStream>(of, estimator.flows(), time_line) : nullptr),
      guarantee(guarantee_of(of.scene, estimator)) {
  set_end(options.duration);
}

void Estimation::restart(const ContactMessage& message) {
  if (stream) stream->restart();
  time_line.restart(message);
}

bool Estimation::receive(const ContactMessage& message, bool resumes) {
  if (stream && stream->restarts_after(message)) return true;
  return resumes ? time_line.resume(message) : time_line.receive(message);
}

void Estimation::set_end(double t) {
  if (guarantee) guarantee->set_end(t, time_line);
}

EstimateSample Estimation::empty_sample() const {
  EstimateSample sample;
  sample.q.setZero(coordinates);
  sample.u.setZero(coordinates);
  sample.confidence = estimator.no_confidence();
  if (guarantee) guarantee->prepare(sample.confidence);
  return sample;
}

void Estimation::note(const State& state, EstimateSample& sample) const {
  sample.tick = state.tick;
  sample.t = tick_instant(state.tick, estimator.h()).hi;
  sample.closed = state.chi;
  estimator.note(state, sample.confidence);
  name_known_loss(sample.confidence);
}

void Estimation::name_known_loss(Confidence& confidence) const {
  Inconsistency& last = confidence.last;
  if (last.suspicion == Suspicion::none) return;
  // The number of events that determine the state again.
  last.known_loss =
      time_line.events().lost_before(last.t, 2 * static_cast<std::size_t>(coordinates));
  if (last.known_loss) last.suspicion = Suspicion::missing_event;
}

void Estimation::describe(const State& state, bool settled, EstimateSample& sample) {
  note(state, sample);
  estimator.output(state, sample.q, sample.u);
  estimator.confidence(state, sample.confidence);
  if (guarantee) {
    guarantee->complete(time_line, sample.t, settled, estimator, state, sample.q, sample.u,
                        sample.confidence);
  }
  if (stream) stream->widen(sample);
  name_known_loss(sample.confidence);
  // An adaptive filter has estimated supports, not those of the scene.
  const bool of_others = sample.confidence.parameters.any() && sample.confidence.from_filter;
  sample.confidence.penetration =
      of_others ? 0.0
                : penetration(supports, sample.q, sample.t, sample.confidence.sigma_g, length);
}

void Estimation::pass(const State& state) {
  if (guarantee) guarantee->follow(time_line, tick_instant(state.tick, estimator.h()).hi);
}

void Estimation::to_json(nlohmann::ordered_json& report) {
  report["settled_tick"] = time_line.handed_out();
  report["flow_path"] = name(estimator.flows()[0].path());
  if (!stream) return;
  const InputCounts& counts = stream->counts();
  report["input"] = {{"messages", counts.messages},
                     {"refused", counts.refused},
                     {"samples", counts.samples},
                     {"gaps", counts.gaps},
                     {"filled", counts.filled},
                     {"no_room", counts.no_room},
                     {"newest", stream->started() ? nlohmann::ordered_json(stream->newest())
                                                  : nlohmann::ordered_json(nullptr)}};
  nlohmann::ordered_json& lost = report["input"]["lost"] = nlohmann::ordered_json::array();
  for (const EventGap& gap : stream->lost()) lost.push_back({{"from", gap.from}, {"to", gap.to}});
}

}  // namespace sprag
