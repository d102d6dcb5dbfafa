#include "observer/messages.h"

#include <string>

namespace sprag {
namespace {

std::int8_t flag(bool is_set) { return is_set ? 1 : 0; }

// Contacts count from 1 in messages; 0: none.
std::int32_t number_of(int contact, double t) { return t < 0.0 ? 0 : contact + 1; }

template <class Message>
void fill_head(Message& message, const EstimateSample& sample) {
  message.session = sample.session;
  message.utime = sample.utime;
  message.tick = sample.tick;
  message.t = sample.t;
}

void fill(double (&pair)[2], const Uncertain& x) {
  pair[0] = x.value;
  pair[1] = x.sigma;
}

void add(bounds_t& message, char letter, const Eigen::VectorXd& half_widths) {
  for (Eigen::Index i = 0; i < half_widths.size(); ++i) {
    message.name.push_back(letter + std::to_string(i + 1));
    message.half_width.push_back(half_widths[i]);
  }
}

}  // namespace

void fill(estimate_t& message, const EstimateSample& sample) {
  fill_head(message, sample);
  message.f = static_cast<std::int32_t>(sample.q.size());
  message.q.assign(sample.q.begin(), sample.q.end());
  message.u.assign(sample.u.begin(), sample.u.end());
  message.closed = static_cast<std::int64_t>(sample.closed);
  message.settled_tick = sample.settled_tick;
  const Confidence& confidence = sample.confidence;
  message.estimators =
      static_cast<std::int8_t>((confidence.has_replica ? 1 : 0) + (confidence.has_filter ? 2 : 0));
  message.from_filter = flag(confidence.from_filter);
  message.bound = confidence.bound;
  message.deviations = static_cast<std::int32_t>(confidence.sigma_q.size());
  message.sigma_q.assign(confidence.sigma_q.begin(), confidence.sigma_q.end());
  message.sigma_u.assign(confidence.sigma_u.begin(), confidence.sigma_u.end());
  message.gaps = static_cast<std::int32_t>(confidence.sigma_g.size());
  message.sigma_g.assign(confidence.sigma_g.begin(), confidence.sigma_g.end());
  const Innovation& closing = confidence.has_replica ? confidence.replica : confidence.filter;
  message.closing = closing.t;
  message.closing_contact = number_of(closing.contact, closing.t);
  message.replica_gap = confidence.replica.gap;
  message.filter_gap = confidence.filter.gap;
  message.sigma_filter_gap = confidence.filter.deviation;
  message.inconsistencies = confidence.inconsistencies;
  message.suspect_t = confidence.last.t;
  message.suspect_contact = number_of(confidence.last.contact, confidence.last.t);
  message.suspicion = static_cast<std::int8_t>(confidence.last.suspicion);
}

void fill(outputs_t& message, const EstimateSample& sample, bool settled,
          std::span<const Output> outputs) {
  fill_head(message, sample);
  message.settled = flag(settled);
  message.from_filter = flag(sample.confidence.from_filter);
  message.n = static_cast<std::int32_t>(outputs.size());
  message.name.resize(outputs.size());
  message.value.resize(outputs.size());
  message.sigma.resize(outputs.size());
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    message.name[i] = outputs[i].name;
    message.value[i] = value(outputs[i], sample.q, sample.u);
    message.sigma[i] = sigma_of_output(sample.confidence, i);
  }
}

void fill(bounds_t& message, const EstimateSample& sample, std::span<const Output> outputs) {
  fill_head(message, sample);
  message.bound = sample.confidence.bound;
  message.refutations = sample.confidence.refutations;
  message.name.clear();
  message.half_width.clear();
  add(message, 'q', sample.confidence.bound_q);
  add(message, 'g', sample.confidence.bound_g);
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    message.name.push_back(outputs[i].name);
    message.half_width.push_back(bound_of_output(sample.confidence, i));
  }
  message.n = static_cast<std::int32_t>(message.name.size());
}

void fill(parameters_t& message, const EstimateSample& sample) {
  fill_head(message, sample);
  const ParameterEstimates& parameters = sample.confidence.parameters;
  message.n = static_cast<std::int32_t>(parameters.keys->size());
  message.key = *parameters.keys;
  message.value.assign(parameters.values.begin(), parameters.values.end());
  message.sigma.assign(parameters.sigmas.begin(), parameters.sigmas.end());
  message.accepted = parameters.accepted;
  message.known = parameters.known;
  message.identifications = parameters.identifications;
  message.from_filter = flag(sample.confidence.from_filter);
}

void fill(impact_t& message, const ImpactRecord& record, std::int64_t session, std::int64_t utime) {
  message.session = session;
  message.utime = utime;
  message.t = record.t;
  message.contact = record.contact + 1;
  message.kind = static_cast<std::int8_t>(record.kind);
  message.from_filter = flag(record.from_filter);
  message.sustained = flag(record.sustained);
  fill(message.time, record.time);
  fill(message.velocity_before, record.before);
  fill(message.velocity_after, record.after);
  fill(message.impulse, record.impulse);
  fill(message.force_begin, record.force_begin);
  fill(message.force_end, record.force_end);
  fill(message.force_largest, record.force_largest);
  fill(message.force_impulse, record.force_impulse);
}

void fill(prediction_t& message, const Prediction& prediction, std::int64_t session,
          std::int64_t utime) {
  message.session = session;
  message.utime = utime;
  message.made_at = prediction.made_at;
  message.certain_until = prediction.certain_until;
  message.count = static_cast<std::int32_t>(prediction.events.size());
  message.t.clear();
  message.contact.clear();
  message.kind.clear();
  message.sigma.clear();
  for (const PredictedEvent& event : prediction.events) {
    message.t.push_back(event.t);
    message.contact.push_back(event.contact + 1);
    message.kind.push_back(static_cast<std::int8_t>(event.kind));
    message.sigma.push_back(event.sigma);
  }
}

}  // namespace sprag
