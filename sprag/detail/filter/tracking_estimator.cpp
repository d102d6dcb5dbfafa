#include "sprag/detail/filter/tracking_estimator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/filter/fall.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {
namespace {

// `adaptive` accepts an identification if the expected energy of its error is below this share of
// the energy of the replica's motion.
constexpr double energy_to_accept = 0.25;

bool has_filter(EstimatorKind kind) { return kind != EstimatorKind::replica; }

}  // namespace

static_assert(Estimator<TrackingEstimator>);

TrackingEstimator::TrackingEstimator(const Scene& scene, double h, EstimatorKind kind)
    : replica_(scene, h),
      kind_(kind),
      trial_(trial_of(scene.prior.confidence)),
      identifies_(kind == EstimatorKind::adaptive) {
  if (!has_filter(kind)) return;
  if (identifies_) {
    filter_ = std::make_unique<SceneFilter>(scene, unknowns_to_adapt(scene), false);
  } else if (!scene.prior.parameters.empty()) {
    filter_ = std::make_unique<SceneFilter>(
        scene, parameters_named(scene, scene.prior.parameters.keys), true);
  } else {
    // The replica, whose flows these are, outlives the filter.
    filter_ = std::make_unique<SceneFilter>(
        scene, std::shared_ptr<Flows>(std::shared_ptr<Flows>(), &replica_.flows()));
  }
}

void TrackingEstimator::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                              TrackingState& state) {
  TrackingState fresh;
  std::swap(fresh.replica, state.replica);  // keeps its memory
  replica_.start(start, k, chi, fresh.replica);
  if (records_ != nullptr) records_->clear();
  if (runs_ != nullptr) runs_->clear();
  state = std::move(fresh);
  state.tick = k;
  state.chi = chi;
  state.track.trial = trial_;
  if (!filter_) return;
  const double t = tick_instant(k, h()).hi;
  state.silence.last_received = t;
  state.silence.last_flight = filter_->first_flight;
  received_at(t, state);
  if (!identifies()) start_from_prior(start, t, state);
}

void TrackingEstimator::note_start(const FilterBelief& of) {
  if (runs_ != nullptr) runs_->push_back({of, {}, {}});
}

void TrackingEstimator::note_event(const ContactEvent& event, double sigma) {
  if (runs_ == nullptr || runs_->empty()) return;
  runs_->back().events.push_back(event);
  runs_->back().sigmas.push_back(sigma);
}

void TrackingEstimator::start_from_prior(const sprag::State& start, double t,
                                         TrackingState& state) {
  SceneFilter& filter = *filter_;
  filter.next = filter.nothing;
  filter.next.sigma = filter.sigma;
  filter_->set_prior(filter.next);
  filter.flight->set(filter.next.z.tail(filter.prior.rows()), false);
  filter.flight->enter(start.q, start.u, t, filter.x);
  filter.filter.restart(t, filter.x, filter.start, state.chi, filter.next);
  note_start(filter.next);
  state.accepted = t;
  if (!set_belief(filter.next, state) || !filter.flight->can_hold(state.chi)) return lose(state);
  state.track.status = filter.scale_is_open ? TrackStatus::tentative : TrackStatus::confirmed;
}

void TrackingEstimator::tick(std::span<const ContactEvent> events, TrackingState& state) {
  if (!filter_ || events.empty()) {
    replica_.tick(events, state.replica);
  } else {
    recorded_ = records_ != nullptr ? records_->size() : 0;
    replica_.open_tick(state.replica);
    for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
      replica_.take(of_one, state.replica);
      receive(of_one, state);
    });
    replica_.close_tick(state.replica);
  }
  state.tick = state.replica.tick;
  state.chi = state.replica.chi;
  if (filter_) watch(tick_instant(state.tick, h()).hi, state);
}

std::int64_t TrackingEstimator::coast(std::int64_t n, TrackingState& state) {
  if (identifies()) return 0;
  if (state.belief && state.track.status != TrackStatus::lost) {
    // Up to the next event that watch() must handle.
    const double until =
        std::min(state.silence.overdue < 0 ? state.silence.next_look : state.silence.missing_from,
                 EventFilter::end_of_burst(*state.belief));
    const double ahead = (until - tick_instant(state.tick, h()).hi) / h() - 1.0;
    if (ahead < static_cast<double>(n)) n = static_cast<std::int64_t>(std::max(ahead, 0.0));
  }
  const std::int64_t taken = replica_.coast(n, state.replica);
  state.tick = state.replica.tick;
  return taken;
}

void TrackingEstimator::apply(std::span<const ContactEvent> events, TrackingState& state) {
  recorded_ = records_ != nullptr ? records_->size() : 0;
  replica_.apply(events, state.replica);
  if (filter_) {
    for_each_instant(events, [&](std::span<const ContactEvent> of_one) { receive(of_one, state); });
  }
  state.chi = state.replica.chi;
  if (filter_) watch(tick_instant(state.tick, h()).hi, state);
}

// Takes the events of one instant. The replica has already taken them; state.chi is the contact
// state before them.
void TrackingEstimator::receive(std::span<const ContactEvent> events, TrackingState& state) {
  const double t = events.front().t;
  watch(t, state);
  for (const ContactEvent& event : events) {
    if (filter_->may_start_inside && event.t == 0.0 && event.kind == ContactEventKind::closes) {
      state.inside |= bit(event.contact);
      lose(state);
    }
    if (event.kind == ContactEventKind::opens) state.inside &= ~bit(event.contact);
    ++state.events;
    state.chi = after(state.chi, event);
  }
  const BeliefRef before = state.belief;
  if (state.track.status != TrackStatus::lost) take(events, state);
  if (records_ != nullptr) {
    for (const ContactEvent& event : events) {
      ImpactRecord& record = (*records_)[recorded_++];
      record.time.sigma = filter_->sigma;
      if (state.track.status == TrackStatus::confirmed) describe(before, event, state, record);
    }
  }
  if (state.track.status == TrackStatus::lost) reset(t, events, state);
  received_at(t, state);
}

void TrackingEstimator::record_in(std::vector<ImpactRecord>& records) {
  recorder_ = std::make_unique<ImpactRecorder>(flows().dynamics(), records, 0.0, false);
  replica_.record_in(recorder_.get());
  records_ = &records;
  if (!filter_ || filter_->family) return;
  forces_ =
      std::make_unique<ImpactRecorder>(flows().dynamics(), with_forces_, filter_->sigma, true);
}

// Follows the forces of held contacts from the time of the belief to t.
void TrackingEstimator::follow_forces(const FilterBelief& before, double t) {
  const Flow* flow = before.held != 0 ? flows().find(before.held) : nullptr;
  if (flow == nullptr) return;
  SceneFilter& filter = *filter_;
  const Eigen::Index f = filter.flight->n(), size = 2 * f;
  filter.flight->state(before.z.head(size), before.t, filter.q, filter.u);
  Motion motion;
  flow->enter(filter.q, filter.u, at(before.t), Eigen::VectorXd::Zero(std::popcount(before.held)),
              motion);
  const Eigen::MatrixXd S = product(filter.flight->to_state(), before.S.topRows(size));
  forces_->fly(motion, t - before.t, S.topRows(f), S.bottomRows(f), S.cols());
}

void TrackingEstimator::measure_release(const FilterBelief& before, const ContactEvent& event) {
  if (!contains(before.held, event.contact)) return;
  filter_->filter.mean(event.t, before);
  Flight::Gap force;
  const Eigen::VectorXd& row = filter_->filter.force_row(event.contact, event.t, force);
  forces_->measured_release(event.contact, row, -force.g, square(force.velocity * before.sigma));
}

// Describes an event by the beliefs before and after it.
void TrackingEstimator::describe(const BeliefRef& before, const ContactEvent& event,
                                 const TrackingState& state, ImpactRecord& record) {
  if (!before) return;
  const FilterBelief& of = *state.belief;
  const double occurred = of.occurred[event.contact];
  // The event was not estimated: it was rejected, or held contacts already constrain its direction.
  if (event.kind != ContactEventKind::opens && occurred == before->occurred[event.contact]) return;
  const ImpactEstimate& impact = of.impact;
  if (impact.time_sigma > 0.0) {
    record.time = {impact.time, impact.time_sigma};
  } else {
    record.time = {occurred, of.sigma};
  }
  record.before = {impact.before, impact.before_sigma};
  record.after = {impact.after, impact.after_sigma};
  const Dynamics& dynamics = flows().dynamics();
  const double G = dynamics.G()(event.contact, event.contact);
  record.impulse.value = (impact.after - impact.before) / G;
  // The errors of both speeds have one sign, so the deviations add up.
  record.impulse.sigma = (impact.after_sigma + impact.before_sigma) / G;
  record.from_filter = true;
  if (!forces_) return;
  follow_forces(*before, event.t);
  if (event.kind == ContactEventKind::opens) measure_release(*before, event);
  forces_->add(record);
  record = with_forces_.back();
  with_forces_.clear();
}

// Sets filter_->x to the replica's state at t, for the machine with the estimated parameters.
void TrackingEstimator::find_replica(const TrackingState& state, double t) {
  SceneFilter& filter = *filter_;
  replica_.output(state.replica, filter.q, filter.u);
  if (state.belief) filter.flight->set(state.belief->z.tail(filter.flight->unknowns()), false);
  filter.flight->enter(filter.q, filter.u, t, filter.x);
}

void TrackingEstimator::lose(TrackingState& state) const {
  if (forces_) forces_->start();
  // A start inside a contact defers the start of the filter; the prior's scale remains valid.
  if (state.inside == 0) state.track.scale_is_known = false;
  state.track.status = TrackStatus::lost;
  state.track.doubts = false;
  state.track.fitting = 0;
  state.track.mean_square = 1.0;
}

bool TrackingEstimator::set_belief(const FilterBelief& of, TrackingState& state) const {
  if (!of.is_finite()) return false;
  state.earlier = {};
  state.belief = filter_->pool->put(of);
  state.silence.open_until = 0.0;
  if (!state.belief) ++state.forgotten;
  return static_cast<bool>(state.belief);
}

// As set_belief(), after an event: keeps the beliefs before it.
bool TrackingEstimator::add_belief(const FilterBelief& of, TrackingState& state) const {
  if (!of.is_finite()) return false;
  auto earlier = std::move(state.earlier);
  std::move_backward(earlier.begin(), earlier.end() - 1, earlier.end());
  earlier.front() = std::move(state.belief);
  if (!set_belief(of, state)) return false;
  state.earlier = std::move(earlier);
  return true;
}

// The last belief whose event is not certainly later than t.
const FilterBelief& TrackingEstimator::belief_at(double t, const TrackingState& state) {
  const FilterBelief* last = &*state.belief;
  for (const BeliefRef& before : state.earlier) {
    const ImpactEstimate& event = last->impact;
    const double begins =
        event.time_sigma > 0.0 ? event.time - indistinct * event.time_sigma : last->t;
    if (!before || t >= begins) break;
    last = &*before;
  }
  return *last;
}

// Returns twice the energy of the replica's present motion and updates the largest value.
double TrackingEstimator::note_energy(TrackingState& state) {
  replica_.output(state.replica, filter_->q, filter_->u);
  const double energy = filter_->motion_energy();
  state.track.energy = std::max(state.track.energy, energy);
  return energy;
}

void TrackingEstimator::take(std::span<const ContactEvent> events, TrackingState& state) {
  SceneFilter& filter = *filter_;
  FilterBelief& next = filter.next;
  next = *state.belief;
  const ContactEvent& event = events.back();
  const bool separable = filter.filter.can_separate(events, next);
  const bool taken = separable && filter.filter.take(events, next);
  if (!separable || !filter.flight->can_hold(next.held)) return lose(state);
  state.track.mean_square += (next.square - state.track.mean_square) / innovation_window;
  if (!taken || !(next.square < square(certain)) ||
      !(state.track.mean_square < largest_mean_innovation)) {
    const Inconsistency inconsistency{event.t, next.innovation.contact,
                                      suspicion(*state.belief, next), next.square};
    const bool single = events.size() == 1 && event.kind == ContactEventKind::pulse;
    if (inconsistency.suspicion == Suspicion::spurious_event && single && may_doubt(state)) {
      state.track.mean_square = std::min(state.track.mean_square, 1.0);
      return doubt(inconsistency, state);
    }
    return fail(inconsistency, state);
  }
  for (const ContactEvent& each : events) note_event(each, next.sigma);
  state.track.doubts = false;
  if (!add_belief(next, state)) return lose(state);
  ++state.track.fitting;
  note_energy(state);
  if (state.track.fitting >= 8 * state.track.trial) state.track.trial = trial_;
  if (scale_is_lost(state) || state.track.fitting < to_confirm(state)) return;
  state.track.status = TrackStatus::confirmed;
  state.track.inflation = 1.0;
}

// The scale of a homogeneous machine's motion is unobservable. With exact times `timing` has the
// prior's scale until it loses the track; with a jitter the scale is unknown from the start.
bool TrackingEstimator::scale_is_lost(const TrackingState& state) const {
  if (filter_->scale_is_open) return true;
  return kind_ == EstimatorKind::timing && filter_->filter.model().homogeneous &&
         !state.track.scale_is_known;
}

std::int64_t TrackingEstimator::to_confirm(const TrackingState& state) const {
  return 2 * static_cast<std::int64_t>(filter_->flight->n()) + state.track.trial;
}

// Classifies a gate failure (clear_share): an event near a zero crossing, in place or in time,
// is not spurious.
Suspicion TrackingEstimator::suspicion(const FilterBelief& before, const FilterBelief& after) {
  const Innovation& innovation = after.innovation;
  const SceneFilter::LastFlight flight =
      filter_->last_flight(innovation.contact, innovation.t, before);
  const double far = clear_share * std::max(after.length, flight.highest);
  if (flight.inside > clear_share && flight.lowest < -far) {
    return Suspicion::missing_event;
  }
  const bool is_near = flight.ends_near || innovation.gap <= far;
  return is_near ? Suspicion::model : Suspicion::spurious_event;
}

// Whether the track tolerates a spurious or a missing event: it is confirmed by events, and the
// last event fitted.
bool TrackingEstimator::may_doubt(const TrackingState& state) const {
  return state.track.status == TrackStatus::confirmed && !state.track.doubts &&
         state.track.fitting >= to_confirm(state);
}

void TrackingEstimator::doubt(const Inconsistency& inconsistency, TrackingState& state) {
  state.track.doubts = true;
  ++state.inconsistencies;
  state.last = inconsistency;
}

// Bridges a missing impact: takes it where the gap of the mean fell through zero.
bool TrackingEstimator::take_missing(TrackingState& state) {
  SceneFilter& filter = *filter_;
  const FilterBelief& present = *state.belief;
  const int contact = state.silence.overdue;
  const double crossing = filter_->crossing_before(state.silence.overdue_since, contact, present);
  if (crossing == -infinity) return false;
  filter.next = present;
  // At overdue_since the gap was negative beyond doubt. So the interval since the crossing bounds
  // the error of the impact time.
  filter.next.sigma = state.silence.overdue_since - crossing;
  filter.next.reported[contact] = -infinity;
  const ContactEvent missing{crossing, contact, ContactEventKind::pulse};
  if (!filter.filter.take(missing, filter.next)) return false;
  note_event(missing, filter.next.sigma);
  filter.next.sigma = present.sigma;
  return add_belief(filter.next, state);
}

void TrackingEstimator::fail(const Inconsistency& inconsistency, TrackingState& state) {
  const bool confirmed = state.track.fitting >= to_confirm(state);
  const bool believed =
      state.track.status == TrackStatus::confirmed && (confirmed || !identifies());
  ++state.inconsistencies;
  state.last = inconsistency;
  if (state.track.status == TrackStatus::confirmed) {
    state.track.trial = std::min(2 * state.track.trial, longest_trial);
  }
  if (!confirmed) {
    state.track.inflation *= std::sqrt(std::max(inconsistency.square, largest_mean_innovation));
    if (runs_ != nullptr && !runs_->empty()) runs_->back().failed = true;
  }
  lose(state);
  if (identifies() && believed) {
    // If the machine has changed, it did so at this event.
    state.changed = std::max<std::int64_t>(state.events - 1, 0);
  } else if (identifies()) {
    state.belief = {};
    state.accepted = -1.0;
  } else if (!confirmed) {
    FilterBelief& next = filter_->next;
    next = *state.belief;
    filter_->set_prior(next);
    set_belief(next, state);
  }
}

// Handles overdue and missing events and ends of bursts up to t. The times at which it finds them
// depend on the events alone.
void TrackingEstimator::watch(double t, TrackingState& state) {
  SceneFilter& filter = *filter_;
  while (state.belief && state.track.status != TrackStatus::lost) {
    const double end = EventFilter::end_of_burst(*state.belief);
    const double until = std::min(t, end);
    look(until, state);
    if (state.silence.overdue >= 0 && state.silence.missing_from <= until) {
      const double from = state.silence.missing_from;
      const Inconsistency inconsistency{from, state.silence.overdue, Suspicion::missing_event, 0.0};
      const bool held = contains(state.belief->held, state.silence.overdue);
      if (!held && may_doubt(state) && take_missing(state)) {
        doubt(inconsistency, state);
      } else {
        fail(inconsistency, state);
      }
      received_at(from, state);
      continue;
    }
    if (!(end <= t)) return;
    filter.next = *state.belief;
    filter.filter.expire(end, filter.next);
    if (!set_belief(filter.next, state)) return lose(state);
    received_at(end, state);
  }
}

// Checks for an overdue event up to t, at times that do not depend on t.
void TrackingEstimator::look(double t, TrackingState& state) {
  EventFilter& filter = filter_->filter;
  const FilterBelief& belief = *state.belief;
  while (state.silence.overdue < 0 && state.silence.next_look <= t) {
    const double now = state.silence.next_look;
    state.silence.next_look = now + until_next_look(now, state);
    if (!(now > belief.t)) continue;
    state.silence.overdue = filter.overdue(now, belief);
    if (state.silence.overdue < 0) {
      state.silence.open_until = filter.open_until(now, belief);
      state.silence.next_look =
          state.silence.open_until + until_next_look(state.silence.open_until, state);
      continue;
    }
    state.silence.overdue_since = state.silence.missing_from = now;
    if (contains(belief.held, state.silence.overdue)) continue;
    const double crossing = filter_->crossing_before(now, state.silence.overdue, belief);
    // The master does not report the impacts of a completed chatter.
    const double late = clear_share * (crossing - belief.t) + filter.model().chatter_time;
    state.silence.missing_from = std::max(now, crossing + late);
  }
}

// Interval to the next check at t. It assumes that a flight takes about as long as the previous
// one.
double TrackingEstimator::until_next_look(double t, const TrackingState& state) const {
  const double first = std::max(std::min(filter_->longest_look, state.silence.last_flight) / looks,
                                filter_->least_look);
  return std::min(std::max((t - state.silence.last_received) / looks, first),
                  filter_->longest_look);
}

// Restarts the checks for overdue events at t, and clears `overdue`.
void TrackingEstimator::received_at(double t, TrackingState& state) const {
  if (t > state.silence.last_received) state.silence.last_flight = t - state.silence.last_received;
  state.silence.last_received = t;
  state.silence.next_look = t + until_next_look(t, state);
  state.silence.overdue = -1;
}

// Resets the state of a lost track to that of the replica, which is at t, after these events.
void TrackingEstimator::reset(double t, std::span<const ContactEvent> events,
                              TrackingState& state) {
  if (!state.belief) return;
  SceneFilter& filter = *filter_;
  const bool exact_parameters = filter.flight->unknowns() == 0;
  if ((exact_parameters && state.inside != 0) || !filter.flight->can_hold(state.chi)) return;
  find_replica(state, t);
  filter.next = *state.belief;
  // After a loss without a gate failure the inflation follows from the distance, in energy, between
  // the replica and the lost estimate. It never exceeds the energy of the motion.
  if (filter.of_start > 0.0 && state.track.inflation == 1.0) {
    filter.filter.fly_mean(t, filter.next);
    filter.off = filter.flight->x() - filter.x;
    const double off = filter.flight->twice_energy(filter.off) / filter.of_start;
    if (off > square(state.track.inflation)) state.track.inflation = std::sqrt(off);
  }
  const double motion = std::max(note_energy(state), state.track.energy);
  const double most =
      filter.of_start > 0.0 ? std::sqrt(std::max(motion / filter.of_start, 1.0)) : 1.0;
  state.track.inflation = std::min(state.track.inflation, most);
  filter.inflated = state.track.inflation * filter.start;
  filter.filter.restart(t, filter.x, filter.inflated, state.chi, filter.next);
  for (const ContactEvent& event : events) filter.next.reported[event.contact] = t;
  if (!set_belief(filter.next, state)) return;
  note_start(filter.next);
  state.track.status = TrackStatus::tentative;
  received_at(t, state);
}

bool TrackingEstimator::adopt(const AdaptationResult& result, TrackingState& state) {
  ++state.identifications;
  const auto is_accurate = [&] {
    filter_->of_state = result.belief.S.topRows(2 * filter_->flight->n());
    const double of_error = filter_->flight->twice_energy(filter_->of_state);
    return of_error < energy_to_accept * note_energy(state);
  };
  if (!result.accepted || !is_accurate()) return false;
  lose(state);
  if (!set_belief(result.belief, state)) return true;
  state.accepted = tick_instant(state.tick, h()).hi;
  if (!result.state_is_known || state.chi != 0) return true;
  state.track.status = TrackStatus::confirmed;
  state.track.fitting = to_confirm(state);
  return true;
}

bool TrackingEstimator::is_believed(const TrackingState& state) {
  return state.track.status == TrackStatus::confirmed && state.silence.overdue < 0;
}

// Checks are rare. A sigma is claimed only if no event is overdue at this tick. None is before the
// estimated time of the last event, and while all gaps are known to be positive.
bool TrackingEstimator::claims(const TrackingState& state) const {
  const double t = tick_instant(state.tick, h()).hi;
  return is_believed(state) && (t < std::max(state.belief->t, state.silence.open_until) ||
                                filter_->filter.overdue(t, *state.belief) < 0);
}

bool TrackingEstimator::shows_filter(const TrackingState& state) const {
  if (!filter_) return false;
  return is_believed(state) ||
         (kind_ == EstimatorKind::timing && state.track.status != TrackStatus::lost);
}

void TrackingEstimator::output(const TrackingState& state, Eigen::Ref<Eigen::VectorXd> q,
                               Eigen::Ref<Eigen::VectorXd> u) {
  if (!shows_filter(state)) {
    replica_.output(state.replica, q, u);
    return;
  }
  const double t = tick_instant(state.tick, h()).hi;
  const Eigen::VectorXd& x = filter_->filter.publish_mean(t, belief_at(t, state));
  filter_->flight->state(x, t, q, u);
}

Confidence TrackingEstimator::no_confidence() const {
  Confidence confidence = replica_.no_confidence();
  if (!filter_) return confidence;
  const Eigen::Index f = filter_->flight->n();
  confidence.has_filter = true;
  confidence.has_replica = kind_ != EstimatorKind::timing;
  confidence.sigma_q.setConstant(f, infinity);
  confidence.sigma_u = confidence.sigma_q;
  confidence.sigma_g.setConstant(filter_->flight->contacts(), infinity);
  confidence.sigma_outputs.setConstant(filter_->outputs.cols(), infinity);
  if (!filter_->family) return confidence;
  confidence.parameters.keys = filter_->keys;
  confidence.parameters.values = nominal_values(filter_->family->unknowns());
  confidence.parameters.sigmas.setConstant(confidence.parameters.values.size(), infinity);
  return confidence;
}

void TrackingEstimator::note(const TrackingState& state, Confidence& confidence) const {
  replica_.note(state.replica, confidence);
  if (!filter_) return;
  confidence.from_filter = shows_filter(state);
  confidence.filter = {};
  if (state.belief && state.track.status != TrackStatus::lost) {
    confidence.filter = state.belief->innovation;
  }
  confidence.inconsistencies = state.inconsistencies;
  confidence.last = state.last;
  confidence.forgotten = state.forgotten;
  confidence.scale_is_lost = scale_is_lost(state);
  confidence.parameters.accepted = state.accepted;
  confidence.parameters.identifications = state.identifications;
  confidence.parameters.known = state.belief ? state.belief->t : -1.0;
}

void TrackingEstimator::confidence(const TrackingState& state, Confidence& confidence) {
  note(state, confidence);
  if (!filter_) return;
  const double t = tick_instant(state.tick, h()).hi;
  bool is_known = claims(state);
  if (is_known) {
    const FilterBelief& belief = belief_at(t, state);
    filter_->filter.publish(t, belief);
    is_known = filter_->filter.is_determined();
    if (is_known) filter_->fill_deviations(t, belief, confidence);
  }
  if (!is_known) {
    confidence.sigma_q.setConstant(infinity);
    confidence.sigma_u.setConstant(infinity);
    confidence.sigma_g.setConstant(infinity);
    confidence.sigma_outputs.setConstant(infinity);
  }
  if (!filter_->family) return;
  filter_->fill_parameters(t, state.belief ? &*state.belief : nullptr, confidence.parameters);
}

Eigen::MatrixXd TrackingEstimator::belief(const TrackingState& state, Belief& belief) {
  return filter_->belief(tick_instant(state.tick, h()).hi, *state.belief, belief);
}

Prediction TrackingEstimator::predict(const TrackingState& state, const Predictor& predictor,
                                      double ahead) {
  const double t = tick_instant(state.tick, h()).hi;
  if (!filter_ || identifies() || !claims(state)) return {t, t, {}};
  sprag::Belief from;
  const Eigen::MatrixXd S_c = filter_->belief(t, *state.belief, from);
  const FilterModel& model = filter_->filter.model();
  if (model.drift.cols() + model.kicks.cols() > 0) {
    const Eigen::Index f = from.q.size(), known = from.columns;
    Eigen::MatrixXd noise(2 * f, model.drift.cols() + model.kicks.cols());
    noise.leftCols(model.drift.cols()) = model.drift;
    if (model.kicks.cols() > 0) noise.rightCols(model.kicks.cols()) = model.kicks;
    const Eigen::MatrixXd drift = std::sqrt(ahead) * product(filter_->flight->to_state(), noise);
    from.columns += drift.cols();
    from.S_q.conservativeResize(f, from.columns);
    from.S_u.conservativeResize(f, from.columns);
    from.S_q.rightCols(from.columns - known) = drift.topRows(f);
    from.S_u.rightCols(from.columns - known) = drift.bottomRows(f);
  }
  if (!filter_->family) return predictor.predict(t, state.chi, from, ahead);
  const SceneValues& family = *filter_->family;
  const Eigen::Index P = S_c.rows();
  const Eigen::VectorXd c = state.belief->z.tail(P);
  return predictor.predict(t, state.chi, from, ahead, [&](const Eigen::VectorXd& xi) {
    const Eigen::VectorXd at = c + S_c * xi.head(S_c.cols());
    Eigen::VectorXd values(P);
    for (Eigen::Index k = 0; k < P; ++k) {
      values[k] = family.unknowns()[static_cast<std::size_t>(k)].value(at[k]);
    }
    return std::make_shared<const Flows>(with(family.nominal(), family.unknowns(), values).model);
  });
}

}  // namespace sprag
