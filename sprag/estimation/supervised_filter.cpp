#include "sprag/estimation/supervised_filter.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// Of all that can be off: a filter that expects more of its error has lost more than it has learnt.
constexpr double most_energy = 1.2;
// Of the variances of a start that was too sure.
constexpr double least_widening = start_widening * start_widening;

// Shares of a flight's duration, and of the machine's displacements, that are no matter of event
// times or of a model that is slightly wrong.
constexpr double long_inside = 0.05;
constexpr double far_away = 0.05;

}  // namespace

SupervisedFilter::SupervisedFilter(const Model& model, double h, Uncertainty uncertainty)
    : flows_(std::make_shared<Flows>(model)),
      replica_(flows_, h),
      filter_(flows_, h, std::move(uncertainty)) {
  q_.setZero(model.coordinates());
  u_.setZero(model.coordinates());
}

void SupervisedFilter::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                             SupervisedState& state) {
  replica_.start(start, k, chi, state);
  filter_.start(start, k, chi, state.filter);
  state.trusted = !filter_.scale_is_open();
  state.probation = {};
  state.inconsistencies = 0;
  state.last = {};
  state.begun = 0;
  state.energy = 0.0;
}

void SupervisedFilter::tick(std::span<const ContactEvent> events, SupervisedState& state) {
  const std::int64_t silences = state.filter.silences;
  if (events.empty()) {
    replica_.tick(events, state);
    filter_.tick(events, state.filter);
    supervise_silence(silences, state);
    return;
  }
  replica_.open_tick(state);
  filter_.open_tick(state.filter);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    const std::int64_t before = state.filter.silences;
    const std::int64_t believed = state.filter.instants;
    replica_.take(of_one, state);
    filter_.take(of_one, state.filter);
    supervise_silence(before, state);
    supervise(believed, state);
    record(state);
  });
  const std::int64_t before = state.filter.silences;
  replica_.close_tick(state);
  filter_.close_tick(state.filter);
  supervise_silence(before, state);
}

void SupervisedFilter::apply(std::span<const ContactEvent> events, SupervisedState& state) {
  const std::int64_t believed = state.filter.instants;
  replica_.apply(events, state);
  filter_.apply(events, state.filter);
  supervise(believed, state);
  record(state);
}

void SupervisedFilter::record_in(std::vector<ImpactRecord>& records) {
  const Dynamics& dynamics = flows_->dynamics();
  const double jitter = filter_.jitter();
  replica_recorder_ = std::make_unique<ImpactRecorder>(dynamics, of_replica_, jitter, false);
  filter_recorder_ =
      std::make_unique<ImpactRecorder>(dynamics, of_filter_, jitter, !filter_.scale_is_open());
  replica_.record_in(replica_recorder_.get());
  filter_.record_in(filter_recorder_.get());
  records_ = &records;
}

// By whoever the estimate is of now.
void SupervisedFilter::record(const SupervisedState& state) {
  if (records_ == nullptr) return;
  const std::vector<ImpactRecord>& chosen = state.trusted ? of_filter_ : of_replica_;
  records_->insert(records_->end(), chosen.begin(), chosen.end());
  of_replica_.clear();
  of_filter_.clear();
}

// An event has not come that had to: from then on nothing is known of the filter's state, and at
// the next event it starts from the replica's.
void SupervisedFilter::supervise_silence(std::int64_t silences, SupervisedState& state) const {
  if (state.filter.silences == silences) return;
  ++state.inconsistencies;
  state.trusted = false;
  state.last = state.filter.last;
}

// At an instant with events. `believed`: the filter's last instant before it.
void SupervisedFilter::supervise(std::int64_t believed, SupervisedState& state) {
  replica_.output(state, q_, u_);
  state.energy = std::max(state.energy, filter_.energy(q_, u_));
  // A start may be told to be better known than it is, or than events that jitter keep it.
  const double of_start = filter_.energy_of_start();
  const double at_most = std::max(of_start, state.energy);
  const Consistency& consistency = state.filter.consistency;
  const auto restart = [&] {
    state.trusted = false;
    // Before 2 f events have determined its state a filter knows no more than it was told, and that
    // it was too sure. Of the scene's start the innovation says by how much.
    const bool determined = believed - state.begun >= 2 * q_.size();
    double more = determined ? 1.0 : least_widening;
    std::optional<std::int64_t> of_filter = believed;
    if (!determined && state.begun == 0) {
      more = std::max(more, consistency.largest);
      of_filter.reset();
    }
    filter_.restart(q_, u_, of_filter, more, at_most / of_start, state.filter);
    state.begun = state.filter.instants;
  };
  // Where sigma is so large against the machine's periods that the filter knows next to nothing,
  // the replica knows more.
  if (state.filter.began_again || state.filter.expected_energy > most_energy * at_most) {
    return restart();
  }
  if (consistency.fits()) {
    if (state.probation.pass(consistency.count, q_.size())) {
      state.trusted = !filter_.scale_is_open();
    }
    return;
  }
  const Innovation& innovation = state.filter.innovation;
  state.last = {innovation.t, innovation.contact, suspicion(state), consistency.largest};
  ++state.inconsistencies;
  if (state.last.suspicion == Suspicion::model) state.probation.fail();
  restart();
}

Suspicion SupervisedFilter::suspicion(const SupervisedState& state) {
  const Innovation& innovation = state.filter.innovation;
  const TimingFilter::LastFlight flight = filter_.last_flight(innovation.contact, state.filter);
  const double far = far_away * std::max(state.filter.terms.length, flight.highest);
  if (flight.inside > long_inside && flight.lowest < -far) return Suspicion::missing_event;
  // Near in place or in time: a spurious event is neither.
  const bool is_near = flight.ends_near || innovation.gap <= far;
  return is_near ? Suspicion::model : Suspicion::spurious_event;
}

void SupervisedFilter::output(const SupervisedState& state, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> u) {
  if (state.trusted) {
    filter_.output(state.filter, q, u);
  } else {
    replica_.output(state, q, u);
  }
}

Confidence SupervisedFilter::no_confidence() const {
  Confidence confidence = filter_.no_confidence();
  confidence.has_replica = true;
  confidence.from_filter = false;
  return confidence;
}

void SupervisedFilter::note(const SupervisedState& state, Confidence& confidence) const {
  filter_.note(state.filter, confidence);
  replica_.note(state, confidence);
  confidence.from_filter = state.trusted;
  confidence.inconsistencies = state.inconsistencies;
  confidence.last = state.last;
}

void SupervisedFilter::confidence(const SupervisedState& state, double initial,
                                  Confidence& confidence) {
  replica_.confidence(state, initial, confidence);
  if (state.trusted) {
    filter_.confidence(state.filter, initial, confidence);
  } else {
    // The replica's own error is not estimated.
    confidence.sigma_q.setConstant(infinity);
    confidence.sigma_u.setConstant(infinity);
    confidence.sigma_g.setConstant(infinity);
    confidence.sigma_outputs.setConstant(infinity);
  }
  note(state, confidence);
}

}  // namespace sprag
