// An instant with events: what it says of the state, the jump, and the covariance behind it.
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "sprag/estimation/force_terms.h"
#include "sprag/estimation/innovation.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/master.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// Times of events are not known better than to so many ulps.
constexpr double time_rounding = 16.0 * std::numeric_limits<double>::epsilon();
// Roundings of a run are not in the covariance: an innovation below this share of its terms is no
// sign of anything.
constexpr double insignificant = 1e-10;
// How much less must be known of gamma than the end of a chatter tells.
constexpr double remainder_tells = 100.0;
// Of what the master takes for a touch: an estimate's gap is not quite the master's.
constexpr double surely_touching = 2.0;
// Impulses that differ by more than this share are different decisions.
constexpr double same_impact = 1e-9;
// Of the force that is left.
constexpr double deviations_to_pull = 2.0;
constexpr double deviations_to_be_sure = 3.0;
// Of squares of deviations.
constexpr double clearly_less = 4.0;

}  // namespace

void TimingFilter::take_instant(std::span<const ContactEvent> events, TimingState& state) {
  if (unknown_time_ && events.size() != 1) {
    // Each has a jitter of its own: that they are told to be of one instant says nothing.
    for (const ContactEvent& event : events) take_instant({&event, 1}, state);
    return;
  }
  const Instant t = state.motion.t;
  if (recorder_ != nullptr && remembers(state)) {
    const Covariance& from = slot(state.instants);
    recorder_->fly(from.mean, t - from.mean.t, from.S_q, from.S_u, from.columns);
  }
  if (!load(state, t)) ++state.forgotten;
  state.motion.flow->state(state.motion, now_.q, now_.u);
  // Of all contacts: roundings of one coordinate go through the modes into the others.
  for (const Contact& contact : flows_->dynamics().model().contacts) {
    state.terms.include(contact, now_.q, now_.u);
  }
  state.began_again = state.unknown;
  event_ = {};
  ContactSet leaving = 0;
  for (const ContactEvent& event : events) {
    if (uncertainty_.may_start_inside && event.kind == ContactEventKind::closes && event.t == 0.0)
      state.inside |= bit(event.contact);
    if (event.kind == ContactEventKind::opens && contains(state.inside, event.contact)) {
      leaving |= bit(event.contact);
    }
  }
  // Nothing is known, or what happened until then is not in the model.
  if (state.unknown || leaving != 0) {
    if (state.unknown) {
      widen_start(state);
      state.consistency = {};
    }
    forget(state);
    go_on(state);
  }
  state.consistency.largest = 0.0;
  const std::int64_t count = state.consistency.count;
  const ContactSet before = state.motion.flow->locked();
  if (unknown_time_) {
    take_uncertain(events.front(), before, state);
  } else {
    take_exact(events, before, state);
  }
  state.inside &= ~leaving;
  columns_.merge(now_);
  if (state.consistency.is_lost() || !is_sane(now_)) begin_again(state);
  judge(events, state.consistency.count - count, state);
  go_on(state);
}

// One impact after the other: what a contact does twice at one instant is two of them.
void TimingFilter::take_exact(std::span<const ContactEvent> events, ContactSet before,
                              TimingState& state) {
  const Model& model = flows_->dynamics().model();
  bool closed = false;
  int stages = 0;
  std::size_t recorded = 0;
  hit_speed2_ = hit_mean2_ = 0.0;
  u_before_ = now_.u;
  if (recorder_ != nullptr) recorder_->before(now_);
  for (std::size_t first = 0; first < events.size();) {
    closings_.clear();
    ContactSet told = 0;
    std::size_t end = first;
    for (; end < events.size() && !contains(told, events[end].contact); ++end) {
      const ContactEvent& event = events[end];
      told |= bit(event.contact);
      state.chi = after(state.chi, event);
      // What is held has g = gamma = 0, whatever else it is said to do at this instant.
      if (contains(state.inside | before, event.contact)) continue;
      if (event.kind == ContactEventKind::opens) continue;
      const double epsilon = event.kind == ContactEventKind::closes
                                 ? 0.0
                                 : model.contacts[index(event.contact)].restitution;
      closings_.push_back({event.contact, epsilon});
    }
    first = end;
    ContactSet closing = 0;
    for (const Closing& of : closings_) closing |= bit(of.contact);
    const ContactSet redundant = drop_redundant(before & state.chi, closing, state);
    std::erase_if(closings_, [&](const Closing& of) { return contains(redundant, of.contact); });
    if (closings_.empty()) continue;
    measure_closings(events.size() > 1, state);
    if (!closed) u_before_ = now_.u;
    closed = true;
    ++stages;
    if (recorder_ != nullptr) recorder_->before(now_);
    strike(before & state.chi, before & ~state.chi, state);
    record(events.subspan(recorded, end - recorded), (closing & ~redundant) | (before & state.chi),
           state);
    recorded = end;
  }
  if (!closed) {
    for_each(before & ~state.chi, [&](int contact) { measure_release(contact, state); });
  }
  record(events.subspan(recorded), 0, state);
  if (!closed) return;
  note_touched(events, state);
  if (stages > 1) add_sequence(events, before, state);
  // By as much as the closing was measured with: impacts at slightly other times would have led to
  // slightly other states, and none of the closings behind is to tell from that how large the
  // motion is.
  const double spread = hit_mean2_ > 0.0 ? std::sqrt(hit_speed2_) / std::sqrt(hit_mean2_) : 1.0;
  add_time_rounding(spread * time_rounding, state);
}

// A contact that touches where another one is hit may be off its support by as much as the master
// takes for a touch. From there the master goes on, and finds it closed where it comes back to
// that.
void TimingFilter::note_touched(std::span<const ContactEvent> events, TimingState& state) const {
  const Model& model = flows_->dynamics().model();
  ContactSet told = 0;
  for (const ContactEvent& event : events) told |= bit(event.contact);
  const double reach = surely_touching * touching * state.terms.length;
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    if (told == bit(i)) continue;
    const double g = gap(model.contacts[index(i)], now_.q, state.motion.t.hi);
    state.touched = std::abs(g) < reach ? state.touched | bit(i) : state.touched & ~bit(i);
  }
  state.touched &= ~state.chi;
}

// Events of the present instant, where these contacts were struck.
void TimingFilter::record(std::span<const ContactEvent> events, ContactSet struck,
                          const TimingState& state) {
  if (recorder_ == nullptr || events.empty()) return;
  recorder_->after(now_, measurement_rounding * state.terms.speed, events.front().t, struck,
                   events);
  recorder_->before(now_);
}

// The same of one that changes nothing.
void TimingFilter::record_as_it_is(const ContactEvent& event, const TimingState& state) {
  if (recorder_ == nullptr) return;
  recorder_->before(now_);
  record({&event, 1}, 0, state);
}

// The same of one that jitters: what the mixture over its time says, which take() has made.
void TimingFilter::record_uncertain(const ContactEvent& event, ContactSet held,
                                    const UnknownTime::Impact& impact) {
  if (recorder_ == nullptr) return;
  const Dynamics& dynamics = flows_->dynamics();
  ImpactRecord record;
  record.t = event.t;
  record.contact = event.contact;
  record.kind = event.kind;
  record.from_filter = true;
  record.time = {event.t - impact.age.mean, impact.age.deviation};
  if (event.kind == ContactEventKind::opens) {
    record.before = record.after = record.impulse = {0.0, 0.0};
    recorder_->add(record);
    return;
  }
  const int i = event.contact;
  const double epsilon = event.kind == ContactEventKind::closes ? 0.0 : restitution_of(i);
  SingleImpact of_one = single_impact(dynamics, i, epsilon, held);
  if (of_one.solved != Solved::yes) of_one = single_impact(dynamics, i, epsilon, held = 0);
  record.before = {impact.before.mean, impact.before.deviation};
  record.after = {impact.after.mean, impact.after.deviation};
  const auto impulse = [&](double Lambda) -> Uncertain {
    return {Lambda * impact.change.mean, std::abs(Lambda) * impact.change.deviation};
  };
  const Eigen::Index of_contact = std::popcount(held & (bit(i) - 1));
  record.impulse = impulse(of_one.Lambda[of_contact]);
  recorder_->add(record);
  Eigen::Index row = 0;
  for_each(held | bit(i), [&](int j) {
    const double Lambda = of_one.Lambda[row++];
    if (j != i) recorder_->push(j, impulse(Lambda));
  });
}

// An impact at a time that is known to a share of it: what it adds to u has moved q by more or
// less.
void TimingFilter::add_time_rounding(double share, const TimingState& state) {
  if (now_.columns == now_.S_q.cols()) columns_.merge(now_);
  now_.S_q.col(now_.columns) = share * state.motion.t.hi * (now_.u - u_before_);
  now_.S_u.col(now_.columns).setZero();
  ++now_.columns;
}

// Several impacts at one instant: nothing says in which order. What it would have been one by one
// as they are told is one more unknown.
void TimingFilter::add_sequence(std::span<const ContactEvent> events, ContactSet before,
                                TimingState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  const Model& model = dynamics.model();
  u_sequence_ = u_before_;
  for (const ContactEvent& event : events) {
    if (event.kind == ContactEventKind::opens) continue;
    if (contains(state.inside | before, event.contact)) continue;
    const Contact& contact = model.contacts[index(event.contact)];
    const double gamma = gap_velocity(contact, u_sequence_, state.motion.t.hi);
    if (!(gamma < 0.0)) continue;
    const double epsilon = event.kind == ContactEventKind::closes ? 0.0 : contact.restitution;
    const double G = dynamics.G()(event.contact, event.contact);
    u_sequence_ -= (1.0 + epsilon) * gamma / G * dynamics.MinvW().col(event.contact);
  }
  on_u_ = u_sequence_ - now_.u;
  if (!(on_u_.norm() > same_impact * (now_.u - u_before_).norm())) return;
  ++state.ambiguous_impacts;
  add_unknown(on_u_, state);
}

// An event that jitters.
void TimingFilter::take_uncertain(const ContactEvent& event, ContactSet before,
                                  TimingState& state) {
  const bool closes = event.kind != ContactEventKind::opens;
  const int i = event.contact;
  // What is thrown off and said to be closed has been reported to open in the meantime, at least.
  if (contains(state.chi, i) || event.kind == ContactEventKind::closes) state.thrown &= ~bit(i);
  state.chi = after(state.chi, event);
  const auto is_known = [&] {
    event_.kind = UncertainEvent::Kind::known;
    record_as_it_is(event, state);
  };
  if (contains(state.inside, i) || contains(before, i) == closes) return is_known();
  UncertainEvent uncertain;
  if (closes) {
    const ContactSet redundant = drop_redundant(before, bit(i), state);
    if (redundant != 0) return is_known();
    uncertain = impact_of(i, event.kind == ContactEventKind::closes, state.motion);
    if (uncertain.kind == UncertainEvent::Kind::pulse &&
        event.t - state.last_report[i] < unknown_time_->indistinct()) {
      // What it throws off is back at once.
      uncertain.kind = UncertainEvent::Kind::burst;
      uncertain.held = before;
    }
    throw_off(before & ~uncertain.held, state);
    state.terms.include(flows_->dynamics().model().contacts[index(i)], now_.q, now_.u);
  } else {
    uncertain = {UncertainEvent::Kind::releases, i, before & ~bit(i), 0,
                 event.t - state.last_report[i]};
    if (is_thrown_off(uncertain, state)) {
      throw_off(bit(i), state);
      state.last_report[i] = event.t;
      return is_known();
    }
  }
  uncertain.in_row = uncertain.kind == UncertainEvent::Kind::burst ? state.bursts[i] + 1 : 0;
  state.bursts[i] = uncertain.in_row;
  state.last_report[i] = event.t;
  set_last(event.t, state, uncertain);
  state.last_time[i] = event.t;
  state.last_deviation[i] = uncertainty_.jitter;
  state.motion.flow->enter(now_.q, now_.u, state.motion.t, no_gaps_.head(std::popcount(before)),
                           state.motion);
  u_before_ = now_.u;
  UnknownTime::Innovation innovation;
  const double gap_before =
      gap(flows_->dynamics().model().contacts[index(i)], now_.q, state.motion.t.hi);
  if (!unknown_time_->take(uncertain, state.motion, state.terms, 0.0, false, now_, innovation)) {
    state.consistency.largest = infinity;
    if (closes) state.innovation = {event.t, i, gap_before, 0.0};
    record_as_it_is(event, state);
    return;
  }
  const UnknownTime::Impact impact = unknown_time_->impact();
  state.last_time[i] = event.t - impact.age.mean;
  state.last_deviation[i] = std::min(impact.age.deviation, uncertainty_.jitter);
  record_uncertain(event, before, impact);
  add_time_rounding(time_rounding, state);
  columns_.merge(now_);
  event_ = uncertain;
  if (!innovation.measured) return;
  note(innovation.square, state.consistency);
  if (closes) state.innovation = {event.t, i, innovation.gap, innovation.deviation};
}

// When the last event of its contact was, and of any, for one at t.
void TimingFilter::set_last(double t, const TimingState& state, UncertainEvent& event) const {
  event.since_last = t - state.last_time[event.contact];
  event.since_deviation = state.last_deviation[event.contact];
  event.quiet_for = t - (state.last_time + deviations_to_be_sure * state.last_deviation).maxCoeff();
}

// What contact i does when it meets its support, to those that are held in this motion as well:
// `now_` is what is known of it.
UncertainEvent TimingFilter::impact_of(int i, bool stays, const Motion& motion) {
  const ContactSet held = motion.flow->locked();
  const double epsilon = restitution_of(i);
  if (stays && epsilon > 0.0) return {UncertainEvent::Kind::stays, i, held};
  UncertainEvent event{stays ? UncertainEvent::Kind::sticks : UncertainEvent::Kind::pulse, i, held};
  if (held == 0) return event;
  const SingleImpact impact = single_impact(flows_->dynamics(), i, epsilon, held);
  if (impact.solved != Solved::yes) return event;
  event.held = impact.staying & ~pulled_off(event, impact, motion);
  return event;
}

// Those that stay by the impact law, but are pulled at behind it: dashpots feel another velocity.
ContactSet TimingFilter::pulled_off(const UncertainEvent& event, const SingleImpact& impact,
                                    const Motion& motion) {
  const Dynamics& dynamics = flows_->dynamics();
  const ContactSet held = motion.flow->locked();
  const ContactSet stays = event.kind == UncertainEvent::Kind::sticks ? bit(event.contact) : 0;
  const Flow* flow = flows_->find(impact.staying | stays);
  if (impact.staying == 0 || flow == nullptr) return 0;
  motion.flow->state(motion, on_flow_, u_sequence_);
  const double change =
      -impact.change *
      gap_velocity(dynamics.model().contacts[index(event.contact)], u_sequence_, motion.t.hi);
  Eigen::Index row = 0;
  for_each(held | bit(event.contact),
           [&](int j) { u_sequence_ += change * impact.Lambda[row++] * dynamics.MinvW().col(j); });
  flow->enter_closed(on_flow_, u_sequence_, motion.t, stuck_);
  ContactSet pulled = 0;
  for_each(impact.staying, [&](int j) {
    const Signal& force = flow->force(j);
    columns_.see(*flow, force, now_, phi_);
    const double sigma = phi_.head(now_.columns).norm();
    if (value(force, stuck_) < -deviations_to_pull * sigma) pulled |= bit(j);
  });
  return pulled;
}

// Contacts of which the one report has come, of an impact that throws them off or that they are
// open: the other is awaited, or was.
void TimingFilter::throw_off(ContactSet thrown, TimingState& state) const {
  if (thrown == 0) return;
  if (state.thrown == 0) state.thrown_since = state.motion.t.hi;
  state.thrown ^= thrown;
}

// Whether a contact that is reported to open was rather thrown off by another's impact, which has
// not been reported, than let go.
bool TimingFilter::is_thrown_off(const UncertainEvent& release, const TimingState& state) {
  // Its force is known once it is known to have been closed.
  if (release.held_for < unknown_time_->latest()) return false;
  double lets_go = -1.0;
  const ContactSet locked = state.motion.flow->locked();
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    if (contains(locked | state.inside, i)) continue;
    const UncertainEvent hit = impact_of(i, restitution_of(i) == 0.0, state.motion);
    if (contains(hit.held, release.contact)) continue;
    const auto misfit = [&](const UncertainEvent& event) {
      return unknown_time_->misfit(event, state.motion, state.terms, now_);
    };
    if (lets_go < 0.0) lets_go = misfit(release).square;
    const UnknownTime::Misfit thrown = misfit(hit);
    if (!(thrown.square + clearly_less < lets_go)) continue;
    // It must have been closed until then.
    const double held = unknown_time_->margin(release, state.motion, state.terms, now_, thrown.age);
    if (thrown.square - 2.0 * log_normal_cdf(held) + clearly_less < lets_go) return true;
  }
  return false;
}

// Those of `closing` that take no impulse of their own, since others hold their directions.
ContactSet TimingFilter::drop_redundant(ContactSet held, ContactSet closing,
                                        TimingState& state) const {
  const ContactSet redundant = closing & ~independent_of(flows_->dynamics().G(), held, closing);
  if (redundant == 0) return 0;
  ++state.redundancy.closings;
  state.redundancy.contact = std::countr_zero(redundant);
  return redundant;
}

// lambda_i = 0, of a contact that is locked.
void TimingFilter::measure_release(int contact, TimingState& state) {
  const Signal& lambda = state.motion.flow->force(contact);
  // What is not known may be larger than the mean.
  const double of_lambda = std::max(columns_.see(*state.motion.flow, lambda, now_, phi_),
                                    largest_terms(lambda, state.motion));
  const Terms size = state.terms.of_coordinates(now_.q, now_.u, largest_w_);
  const double terms = std::max(
      of_lambda, force_terms(flows_->dynamics(), contact, acceleration_[index(contact)], size));
  const double off = time_rounding * state.motion.t.hi * rate(lambda, state.motion);
  if (recorder_ != nullptr) {
    const double floor = measurement_rounding * terms;
    recorder_->measured_release(contact, phi_.head(now_.columns), -value(lambda, state.motion),
                                off * off + floor * floor);
  }
  condition(-value(lambda, state.motion), off * off, terms, state);
}

// g_i = 0 of the contacts that close, gamma_i = 0 of those whose bounces have come to an end.
void TimingFilter::measure_closings(bool several, TimingState& state) {
  const Model& model = flows_->dynamics().model();
  const double t = state.motion.t.hi;
  for (Closing& closing : closings_) {
    closing.gamma = gap_velocity(model.contacts[index(closing.contact)], now_.u, t);
    closing.gamma_rate = rate(state.motion.flow->gap_velocity(closing.contact), state.motion);
  }
  const Eigen::Index c = now_.columns;
  for (std::size_t k = 0; k < closings_.size(); ++k) {
    const Closing& closing = closings_[k];
    const Contact& contact = model.contacts[index(closing.contact)];
    const Functional& acceleration = acceleration_[index(closing.contact)];
    auto phi = phi_.head(c);
    const auto see = [&](const Eigen::MatrixXd& S) {
      phi.noalias() = S.leftCols(c).transpose().lazyProduct(contact.w);
    };
    see(now_.S_u);
    const double speed2 = square(closing.gamma) + phi.squaredNorm();
    hit_speed2_ += speed2;
    hit_mean2_ += square(closing.gamma);
    see(now_.S_q);
    const double gap_before = gap(contact, now_.q, t);
    state.terms.include(contact, now_.q, now_.u);
    double noise = square(time_rounding * t) * speed2;
    const double off = std::max(model.chatter_time, time_rounding * t);
    const double left = off * off * (square(closing.gamma_rate) + variance(acceleration, now_));
    const bool ends_chatter = closing.epsilon == 0.0 && contact.restitution > 0.0;
    // The rest of a completed chatter may still lift the contact, by less than it falls in `off`.
    if (ends_chatter) noise += 0.25 * square(off) * left;
    // The master takes for one impact what touches within its rounding.
    if (several || contains(state.touched, closing.contact)) {
      noise += square(touching * state.terms.length);
    }
    const double deviation = condition(-gap_before, noise, state.terms.length, state);
    if (k == 0 || std::abs(gap_before) > std::abs(state.innovation.gap)) {
      state.innovation = {t, closing.contact, gap_before, deviation};
    }
    if (!ends_chatter || model.contacts.size() > 1) continue;
    see(now_.S_u);
    // What is left of a chatter that is completed is always of one sign, and in proportion to an
    // acceleration that may not be known. It is not taken for more than it can say: where gamma is
    // known almost as well already, it says nothing; nor where contacts may have wedged each other.
    if (phi.squaredNorm() > remainder_tells * left) {
      condition(-gap_velocity(contact, now_.u, t), left, state.terms.speed, state);
    }
  }
}

void TimingFilter::note(double square, Consistency& consistency) const {
  ++consistency.count;
  consistency.mean += (square - consistency.mean) / innovation_window;
  consistency.largest = std::max(consistency.largest, square);
}

// Conditions on the measurement whose columns' parts are phi_: residual = measured - expected.
// Returns the standard deviation that the residual was expected to have.
double TimingFilter::condition(double residual, double noise, double scale, TimingState& state) {
  const Eigen::Index c = now_.columns;
  auto phi = phi_.head(c);
  const double known = phi.squaredNorm();
  const double floor = measurement_rounding * scale;
  const double r = noise + floor * floor;
  const double alpha = known + r;
  const double deviation = std::sqrt(alpha);
  if (deviation > 0.0) {
    note(residual * residual / (alpha + square(insignificant * scale)), state.consistency);
  }
  if (!(known > floor * floor)) return deviation;
  const double before = is_homogeneous_ ? energy_of_motion() : 0.0;
  const PotterUpdate update(phi, residual, r);
  update.apply(now_.q, now_.S_q.leftCols(c));
  update.apply(now_.u, now_.S_u.leftCols(c));
  if (before > 0.0) note_left(energy_of_motion() / before, state);
  return deviation;
}

// Of a homogeneous machine an event is h^T x = 0, and a mean x = S z has the innovation phi^T z,
// phi = S^T h: it is within |z| of its deviations however wrong it is, since a motion that is small
// enough fits any event. So what is watched is how much of the motion the events leave. Those that
// fit one leave that as it is, others make all of it vanish. Where what is left is as unlikely as
// an innovation that does not fit, no motion does.
void TimingFilter::note_left(double share, TimingState& state) const {
  state.log_left += std::log(share);
  if (-2.0 * state.log_left > largest_innovation) state.consistency.largest = infinity;
}

// The impact of the contacts that close, with those of `staying` held; those of `leaving` were
// closed before it and are not after it.
void TimingFilter::strike(ContactSet staying, ContactSet leaving, TimingState& state) {
  const Dynamics& dynamics = flows_->dynamics();
  impact_.set(closings_, staying, leaving);
  const auto contact = [&](Eigen::Index k) {
    return closings_[static_cast<std::size_t>(k)].contact;
  };
  for (Eigen::Index j = 0; j < now_.columns; ++j) {
    auto column = now_.S_u.col(j);
    const auto gamma = [&](Eigen::Index k) { return dynamics.W().col(contact(k)).dot(column); };
    if (!impact_.add_jump(gamma, column)) {
      ++state.refused_impacts;
      return;
    }
  }
  const double t = state.motion.t.hi;
  before_impact_ = now_.u;
  impact_.add_jump(
      [&](Eigen::Index k) {
        return gap_velocity(dynamics.model().contacts[index(contact(k))], before_impact_, t);
      },
      now_.u);
  const auto decision = impact_.decide(before_impact_, now_.u, t, on_u_);
  if (decision == ActiveImpact::Decision::same) return;
  ++state.ambiguous_impacts;
  add_unknown(on_u_, state);
  if (decision == ActiveImpact::Decision::as_reported) now_.u += on_u_;
}

// Velocities that are known up to N(0, 1) times this.
void TimingFilter::add_unknown(const Eigen::VectorXd& on_u, TimingState& state) {
  if (now_.columns == now_.S_q.cols()) columns_.merge(now_);
  // Events may take away again what is added here: that is not the motion's energy.
  const double before = is_homogeneous_ ? energy_of_motion() : 0.0;
  now_.S_q.col(now_.columns).setZero();
  now_.S_u.col(now_.columns) = on_u;
  ++now_.columns;
  if (before > 0.0) {
    state.log_left = std::min(state.log_left + std::log(energy_of_motion() / before), 0.0);
  }
}

}  // namespace sprag
