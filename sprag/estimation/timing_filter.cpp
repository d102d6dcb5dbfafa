#include "sprag/estimation/timing_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numbers>

#include "sprag/mechanics/linear_algebra.h"
#include "sprag/mechanics/scalars.h"
#include "sprag/mechanics/wide_product.h"

namespace sprag {
namespace {

constexpr std::size_t kept_bytes = 64 << 20;
// A restart takes this multiple of the squares by which two estimates differ, and not nothing.
constexpr double reserve = 4.0;
constexpr double least_share = 1e-12;
// An event may be on its way where the gap, or the force, is less than so many of its deviations.
constexpr double deviations_to_expect = 4.0;
// Silence that is less likely than a deviation of seven sigma is no silence.
constexpr double most_square = 49.0;
constexpr double looks_a_period = 16.0;
constexpr double growth_of_looks = 0.25;
// What is published looks at so many of the last reports again.
constexpr std::int64_t most_unsettled = 4;
constexpr double as_good_as_over = 1e-6;  // probability that it is not

}  // namespace

TimingFilter::TimingFilter(Model model, double h, Uncertainty uncertainty)
    : TimingFilter(std::make_shared<Flows>(std::move(model)), h, std::move(uncertainty)) {}

TimingFilter::TimingFilter(std::shared_ptr<Flows> flows, double h, Uncertainty uncertainty)
    : flows_(std::move(flows)),
      h_(h),
      uncertainty_(std::move(uncertainty)),
      impact_(flows_->dynamics()) {
  build_foreseeable(*flows_);
  flight_ = TickedFlight((*flows_)[0], h);
  const int m = flows_->dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(flows_->dynamics().free_acceleration(i));
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  // What merging leaves and a flight adds, and an event before columns are merged again.
  const bool jitters = uncertainty_.jitter > 0.0;
  const Eigen::Index merged = 4 * f() + (jitters ? Belief::most_components : 0);
  const Eigen::Index flown = merged + of_drift + 2;
  const Eigen::Index columns = flown + (jitters ? EventMixture::added_columns(flown) : 3L * m);
  now_.q.setZero(f());
  now_.u.setZero(f());
  now_.S_q.setZero(f(), columns);
  now_.S_u.setZero(f(), columns);
  no_gaps_.setZero(m);
  if (m > 0) largest_w_ = flows_->dynamics().W().cwiseAbs().maxCoeff();
  if (jitters) {
    unknown_time_.emplace(*flows_, uncertainty_.jitter, flown);
    scale_is_open_ = is_homogeneous(flows_->dynamics().model());
  }
  (*flows_)[0].enter(now_.q, now_.u, Instant{}, no_gaps_.head(0), sample_);
  published_ = stuck_ = hit_ = sample_;
  // As many columns as merging leaves. Not initialized: memory that is never used
  // stays the system's.
  const auto bytes = static_cast<std::size_t>(2 * f() * merged) * sizeof(double);
  covariances_.resize(std::clamp<std::size_t>(kept_bytes / bytes, 16, 1024));
  for (Covariance& S : covariances_) {
    S.S_q.resize(f(), merged);
    S.S_u.resize(f(), merged);
    S.mean = sample_;
  }
  for (Eigen::VectorXd* x :
       {&u_before_, &before_impact_, &u_sequence_, &on_u_, &share_, &off_q_, &off_u_, &on_flow_}) {
    x->setZero(f());
  }
  from_start_q_ = inverse(uncertainty_.q);
  from_start_u_ = inverse(uncertainty_.u);
  closings_.reserve(static_cast<std::size_t>(m));
  phi_.setZero(columns);
  Wt_ = flows_->dynamics().W().transpose();
  seen_of_gaps_.setZero(m, columns);
  const Flow& free = (*flows_)[0];
  columns_ = BeliefColumns(free, f(), columns);
  set_looks(free);
  set_start(uncertainty_, now_);
  energy_of_start_ = expected_energy();
}

// Of the error, by the covariance.
double TimingFilter::expected_energy() const {
  const Model& model = flows_->dynamics().model();
  const auto trace = [&](const Eigen::MatrixXd& A, const Eigen::MatrixXd& S) {
    double sum = 0.0;
    for (Eigen::Index j = 0; j < now_.columns; ++j) {
      if (flows_->dynamics().diagonal()) {
        sum += (A.diagonal().array() * S.col(j).array().square()).sum();
      } else {
        for (Eigen::Index i = 0; i < f(); ++i) sum += S(i, j) * A.col(i).dot(S.col(j));
      }
    }
    return 0.5 * sum;
  };
  return trace(model.K, now_.S_q) + trace(model.M, now_.S_u);
}

// Silence is judged when a share of the slowest motion has passed since an instant, and then again
// and again, less and less often at first.
void TimingFilter::set_looks(const Flow& free) {
  const Eigen::Index n = free.frequencies() + free.modes();
  double slowest = infinity;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double omega = free.oscillators().root_kappa()[i];
    if (omega > 0.0) slowest = std::min(slowest, omega);
  }
  const double period = 2.0 * std::numbers::pi / slowest;
  longest_look_ = slowest < infinity ? period / looks_a_period : infinity;
  first_look_ =
      slowest < infinity ? longest_look_ / looks_a_period : flows_->dynamics().model().chatter_time;
}

void TimingFilter::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                         TimingState& state) {
  state.tick = k;
  state.chi = chi;
  state.instants = -1;
  state.inside = state.thrown = 0;
  state.redundancy = {};
  state.refused_impacts = 0;
  state.ambiguous_impacts = 0;
  state.lost = state.silences = state.forgotten = 0;
  state.unknown = state.began_again = false;
  state.last = {};
  state.innovation = {};
  state.consistency = {};
  state.terms = {};
  state.last_report.setConstant(flows_->dynamics().contacts(), -infinity);
  state.last_time = state.last_report;
  state.last_deviation.setZero(flows_->dynamics().contacts());
  state.bursts.setZero(flows_->dynamics().contacts());
  event_ = {};
  last_published_ = {};
  if (recorder_ != nullptr) recorder_->start();
  start_ = start;
  now_.q = start.q;
  now_.u = start.u;
  set_start(uncertainty_, now_);
  state.motion.flow = &(*flows_)[0];
  state.motion.t = tick_instant(k, h_);
  go_on(state);
}

void TimingFilter::restart(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& u, std::int64_t believed,
                           TimingState& state) {
  const Instant t = state.motion.t;
  last_published_ = {};
  const Covariance& from = slot(believed);
  share_.setOnes();
  if (from.instants == believed) {
    load(from, t);
    from.mean.flow->propagate(from.mean, t, sample_);
    sample_.flow->state(sample_, now_.q, now_.u);
    off_q_ = q - now_.q;
    off_u_ = u - now_.u;
    for (Eigen::Index i = 0; i < f(); ++i) {
      // In terms of the mode's deviations at a start.
      const auto of_q = from_start_q_.row(i);
      const auto of_u = from_start_u_.row(i);
      const double apart = square(of_q.dot(off_q_)) + square(of_u.dot(off_u_));
      double unsure = 0.0;
      for (Eigen::Index j = 0; j < now_.columns; ++j) {
        unsure += square(of_q.dot(now_.S_q.col(j))) + square(of_u.dot(now_.S_u.col(j)));
      }
      share_[i] = std::clamp(0.5 * std::max(unsure, reserve * apart), least_share, 1.0);
    }
  }
  set_start(uncertainty_, now_);
  for (Eigen::Index i = 0; i < f(); ++i) {
    now_.S_q.col(i) *= std::sqrt(share_[i]);
    now_.S_u.col(f() + i) *= std::sqrt(share_[i]);
  }
  now_.q = q;
  now_.u = u;
  state.thrown = 0;
  state.consistency = {};
  event_ = {};
  go_on(state);
}

// Mean and covariance, `now_`, go on from the motion's instant.
void TimingFilter::go_on(TimingState& state) {
  const Instant t = state.motion.t;
  const ContactSet all = closed(state);
  const ContactSet kept = state.motion.flow->locked() & all;
  enter(kept | independent_of(flows_->dynamics().G(), kept, all), t, state);
  ++state.instants;
  Covariance& S = slot(state.instants);
  S.instants = state.instants;
  S.columns = now_.columns;
  S.components = now_.components;
  S.weights = now_.weights;
  S.S_q.leftCols(S.columns) = now_.S_q.leftCols(S.columns);
  S.S_u.leftCols(S.columns) = now_.S_u.leftCols(S.columns);
  state.covariance_time = t;
  state.watched = 0.0;
  state.unknown = false;
  if (unknown_time_) state.expected_energy = expected_energy();
  S.mean = state.motion;
  S.event = event_;
}

// The mean goes on from t with these contacts locked at g = 0.
void TimingFilter::enter(ContactSet locked, Instant t, TimingState& state) {
  const Flow* flow = flows_->find(locked);
  if (flow == nullptr) {
    ++state.refused_impacts;
    flow = &(*flows_)[0];
  }
  enter(*flow, t, state.motion);
  TickedFlight::set_anchor(state.motion, state.anchor);
}

// What is not known to fit the locked contacts moves by as little energy as it takes, so that what
// is expected of the error does not grow.
void TimingFilter::enter(const Flow& flow, Instant t, Motion& motion) {
  enter_motion(flow, t, motion);
  flow.close_gap_differences(now_.S_q.leftCols(now_.columns));
}

// The mean alone.
void TimingFilter::enter_motion(const Flow& flow, Instant t, Motion& motion) {
  on_flow_ = now_.q;
  flow.close_gaps(t, on_flow_);
  flow.enter(on_flow_, now_.u, t, no_gaps_.head(std::popcount(flow.locked())), motion);
}

void TimingFilter::tick(std::span<const ContactEvent> events, TimingState& state) {
  if (events.empty() && state.chi == 0) {
    ++state.tick;
    flight_.step(state.tick, state.motion, state.anchor);
    listen(tick_instant(state.tick, h_), state);
    return;
  }
  open_tick(state);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) { take(of_one, state); });
  close_tick(state);
}

void TimingFilter::open_tick(TimingState& state) const {
  state.motion.t = tick_instant(state.tick, h_);
  ++state.tick;
}

void TimingFilter::take(std::span<const ContactEvent> of_one_instant, TimingState& state) {
  const Instant t = at(of_one_instant.front().t);
  // In one step from the last instant, so that roundings do not depend on the tick.
  const Covariance& last = slot(state.instants);
  const Motion& from = last.instants == state.instants ? last.mean : state.motion;
  from.flow->propagate(from, t, state.motion);
  listen(t, state);
  take_instant(of_one_instant, state);
}

void TimingFilter::close_tick(TimingState& state) {
  const Instant t = tick_instant(state.tick, h_);
  Motion& motion = state.motion;
  if (t - motion.t > 0.0) motion.flow->propagate(motion, t, motion);
  TickedFlight::set_anchor(motion, state.anchor);
  listen(t, state);
}

void TimingFilter::apply(std::span<const ContactEvent> events, TimingState& state) {
  take_instant(events, state);
}

void TimingFilter::follow(std::span<const ContactEvent> events, TimingState& state) {
  take(events, state);
}

void TimingFilter::output(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                          Eigen::Ref<Eigen::VectorXd> u) {
  if (unknown_time_ && !state.unknown && publish(state)) {
    q = now_.q;
    u = now_.u;
  } else {
    state.motion.flow->state(state.motion, q, u);
  }
}

// The covariance of a state, moved to t. False where it is gone: as if nothing had been learnt.
bool TimingFilter::load(const TimingState& state, Instant t) {
  const Covariance& S = slot(state.instants);
  if (S.instants == state.instants) {
    load(S, t);
    return true;
  }
  last_published_ = {};
  set_start(uncertainty_, now_);
  columns_.move(*state.motion.flow, t - state.covariance_time, now_);
  return false;
}

void TimingFilter::load(const Covariance& from, Instant t) {
  last_published_ = {};
  const double tau = t - from.mean.t;
  now_.columns = from.columns;
  now_.components = from.components;
  now_.weights = from.weights;
  now_.S_q.leftCols(from.columns) = from.S_q.leftCols(from.columns);
  now_.S_u.leftCols(from.columns) = from.S_u.leftCols(from.columns);
  columns_.move(*from.mean.flow, tau, now_);
  if (tau > 0.0) add_drift(uncertainty_, tau, now_);
}

void TimingFilter::deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> u, Eigen::Ref<Eigen::VectorXd> gap) {
  if (state.unknown || state.inside != 0 || scale_is_open_) {
    q.setConstant(infinity);
    u.setConstant(infinity);
    gap.setConstant(infinity);
    return;
  }
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  const Eigen::Index c = now_.columns;
  const double unseen_q = measurement_rounding * state.terms.length / largest_w_;
  const double unseen_u = measurement_rounding * state.terms.speed / largest_w_;
  for (Eigen::Index i = 0; i < f(); ++i) {
    q[i] = std::hypot(now_.S_q.row(i).head(c).norm(), unseen_q);
    u[i] = std::hypot(now_.S_u.row(i).head(c).norm(), unseen_u);
  }
  multiply(Wt_, now_.S_q.leftCols(c), seen_of_gaps_.leftCols(c));
  for (Eigen::Index i = 0; i < gap.size(); ++i) {
    gap[i] =
        std::hypot(seen_of_gaps_.row(i).head(c).norm(), measurement_rounding * state.terms.length);
  }
}

// What the last reports say of t, in `now_` and `published_`: what they are about may have happened
// by then, or not, and not in their order. Contacts for which it certainly has leave `unsettled`.
// False where there are none.
bool TimingFilter::take_so_far(const TimingState& state, Instant t, ContactSet& unsettled) {
  std::int64_t first = state.instants;
  while (first > 0 && state.instants - first < most_unsettled) {
    const Covariance& last = slot(first);
    const Covariance& before = slot(first - 1);
    const bool kept = last.instants == first && before.instants == first - 1;
    if (!kept || last.event.kind == UncertainEvent::Kind::none) break;
    if (!(t - last.mean.t < unknown_time_->latest()) || last.mean.t - before.mean.t < 0.0) break;
    --first;
  }
  if (first == state.instants) return false;
  load(slot(first), t);
  slot(first).mean.flow->propagate(slot(first).mean, t, published_);
  const Flow* behind = nullptr;  // the last event taken
  ContactSet to_come = 0;        // closed where that is still to be opened, or the other way round
  while (first < state.instants) {
    const Covariance& next = slot(++first);
    UncertainEvent event = next.event;
    if (event.kind == UncertainEvent::Kind::known) continue;
    const ContactSet locked = next.mean.flow->locked();
    const ContactSet changed = locked ^ slot(first - 1).mean.flow->locked();
    if (contains(to_come, event.contact)) {
      // All the more is what follows it.
      to_come ^= changed;
      continue;
    }
    event.held ^= to_come;
    if (behind != nullptr) enter(*behind, t, published_);
    published_.flow->state(published_, now_.q, now_.u);
    UnknownTime::Innovation innovation;
    if (!unknown_time_->take(event, published_, state.terms, t - next.mean.t, true, now_,
                             innovation)) {
      return false;
    }
    columns_.merge(now_);
    if (innovation.to_come < as_good_as_over) {
      unsettled &= ~bit(event.contact);
    } else {
      unsettled |= bit(event.contact);
    }
    if (innovation.to_come > 0.5) to_come ^= changed;
    behind = flows_->find(locked ^ to_come);
    if (behind == nullptr) behind = next.mean.flow;
  }
  if (behind == nullptr) return false;
  enter_motion(*behind, t, published_);
  return true;
}

// Around an event that jitters: the expectation over what may have happened by the present tick,
// in `now_`. False where there is nothing of the kind.
bool TimingFilter::publish(const TimingState& state) {
  const Published wanted{&state, state.tick, state.instants, false};
  const Published& last = last_published_;
  // Mean and deviations are asked for one after the other. Whatever changes a state loads another
  // covariance.
  if (wanted.state != last.state || wanted.tick != last.tick || wanted.instants != last.instants) {
    const bool near = find_published(state);
    last_published_ = wanted;
    last_published_.near = near;
  }
  return last_published_.near;
}

bool TimingFilter::find_published(const TimingState& state) {
  const Instant t = tick_instant(state.tick, h_);
  ContactSet unsettled = recently_reported(state, t);
  bool near = take_so_far(state, t, unsettled);
  if (!near) {
    load(state, t);
    published_ = state.motion;
    published_.t = t;
    published_.flow->state(published_, now_.q, now_.u);
  }
  // Several contacts may have met or left their supports.
  Unheard unheard;
  std::array<UnknownTime::Release, max_contacts> releases;
  std::size_t released = 0;
  while (true) {
    const auto [due, beyond_doubt] = next_due(state, published_, unheard, unsettled);
    if (due.kind == UncertainEvent::Kind::none) break;
    const bool pulse = due.kind == UncertainEvent::Kind::pulse;
    unknown_time_->take_silence(due, published_, state.terms, beyond_doubt, now_);
    unheard.quiet_for = std::min(unheard.quiet_for, unknown_time_->unheard_age());
    // What the others do is seen on the flow behind it, if that is certain.
    const Flow* flow = beyond_doubt ? unknown_time_->flow_after(due) : nullptr;
    // What has closed may be open again, or the other way round; but not more often.
    if (flow == nullptr || flow == published_.flow || contains(unheard.once, due.contact)) {
      unheard.done |= bit(due.contact);
    }
    unheard.once |= bit(due.contact);
    if (flow == nullptr && due.kind == UncertainEvent::Kind::releases) {
      releases[released++] = {due.contact, unknown_time_->unheard_age()};
    } else {
      enter_motion(flow != nullptr ? *flow : *published_.flow, t, published_);
    }
    columns_.merge(now_);
    near = true;
    if (!pulse || !unknown_time_->bring_to_rest(due, published_, state.terms, now_)) continue;
    enter_motion(*published_.flow, t, published_);
    columns_.merge(now_);
  }
  if (released > 1) {
    const std::span all = std::span(releases).first(released);
    std::ranges::sort(all, std::greater<>(), &UnknownTime::Release::age);
    unknown_time_->add_interplay(all, published_, now_);
  }
  return near && is_sane(now_);
}

// Contacts whose last reports may be of what is still to come.
ContactSet TimingFilter::recently_reported(const TimingState& state, Instant t) const {
  ContactSet recently = 0;
  for (int i = 0; i < flows_->dynamics().contacts() && unknown_time_; ++i) {
    if (t.hi - state.last_report[i] < unknown_time_->latest()) recently |= bit(i);
  }
  return recently;
}

// What is most likely to be reported next, if anything is, behind what has happened unheard; of
// open contacts of `unsettled` only what is beyond doubt. `now_` is at the motion's time.
TimingFilter::Due TimingFilter::next_due(const TimingState& state, const Motion& motion,
                                         const Unheard& unheard, ContactSet unsettled) {
  const ContactSet locked = motion.flow->locked();
  const auto any = [&](int i) {
    const bool held = contains(locked, i);
    UncertainEvent event{held ? UncertainEvent::Kind::releases : UncertainEvent::Kind::pulse, i,
                         locked & ~bit(i)};
    set_last(motion.t.hi, state, event);
    event.quiet_for = std::min(event.quiet_for, unheard.quiet_for);
    if (contains(unheard.once, i)) {
      event.since_last = std::min(event.since_last, unheard.quiet_for);
    }
    return event;
  };
  int nearest = -1;
  double least = deviations_to_expect;
  ContactSet beyond_doubt = 0;
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    const bool held = contains(locked, i);
    if (contains(unheard.done | state.inside, i)) continue;
    if (contains(closed(state) & ~unheard.once, i) && !held) continue;
    if (held && (!unknown_time_ || contains(state.thrown, i))) continue;
    const double margin = unknown_time_
                              ? unknown_time_->margin(any(i), motion, state.terms, now_)
                              : value(motion.flow->gap(i), motion) / deviation_of_gap(i, state);
    if (margin < -deviations_to_expect) {
      beyond_doubt |= bit(i);
    } else if (!held && contains(unsettled, i)) {
      continue;
    }
    if (!(margin < least)) continue;
    least = margin;
    nearest = i;
  }
  if (nearest < 0) return {};
  // Of several that have happened the first.
  if (unknown_time_ && std::popcount(beyond_doubt) > 1) {
    double oldest = -1.0;
    for_each(beyond_doubt, [&](int i) {
      unknown_time_->log_of_silence(any(i), motion, state.terms, now_);
      if (!(unknown_time_->unheard_age() > oldest)) return;
      oldest = unknown_time_->unheard_age();
      nearest = i;
    });
  }
  const bool is_over = contains(beyond_doubt, nearest);
  if (contains(locked, nearest)) return {any(nearest), is_over};
  bool stays = restitution_of(nearest) == 0.0;
  if (stays && is_over && unknown_time_) {
    unknown_time_->log_of_silence(any(nearest), motion, state.terms, now_);
    motion.flow->propagate(motion, motion.t + -unknown_time_->unheard_age(), hit_);
    stays = would_stick(nearest, hit_);
  } else if (stays) {
    stays = would_stick(nearest, motion);
  }
  UncertainEvent impact = any(nearest);
  const UncertainEvent of = impact_of(nearest, stays, motion);
  impact.kind = of.kind;
  impact.held = of.held;
  return {impact, is_over};
}

// Whether what takes a contact's gap velocity away also presses it down.
bool TimingFilter::would_stick(int contact, const Motion& motion) {
  const Flow* flow = flows_->find(motion.flow->locked() | bit(contact));
  if (flow == nullptr) return false;
  motion.flow->state(motion, on_flow_, u_before_);
  flow->close_gaps(motion.t, on_flow_);
  flow->enter(on_flow_, u_before_, motion.t, no_gaps_.head(std::popcount(flow->locked())), stuck_);
  return value(flow->force(contact), stuck_) > 0.0;
}

double TimingFilter::deviation_of_gap(int contact, const TimingState& state) const {
  const auto w = flows_->dynamics().W().col(contact);
  double variance = square(measurement_rounding * state.terms.length);
  for (Eigen::Index j = 0; j < now_.columns; ++j) variance += square(w.dot(now_.S_q.col(j)));
  return std::sqrt(variance);
}

// Silence is information: an open contact whose gap is negative beyond doubt must have closed.
void TimingFilter::listen(Instant t, TimingState& state) {
  const double since = t - state.covariance_time;
  // Of two reports of one instant the other must have come.
  if (!state.unknown && state.thrown != 0 &&
      t.hi > state.thrown_since + 2.0 * unknown_time_->latest()) {
    state.unknown = true;
    ++state.silences;
    state.last = {state.thrown_since, std::countr_zero(state.thrown), Suspicion::missing_event,
                  infinity};
  }
  while (!state.unknown) {
    const double next =
        state.watched == 0.0
            ? first_look_
            : state.watched + std::min(growth_of_looks * state.watched, longest_look_);
    if (!(next <= since)) return;
    state.watched = next;
    const Inconsistency silence = overdue(state, state.covariance_time + next);
    if (!(silence.square > most_square)) continue;
    state.unknown = true;
    ++state.silences;
    state.last = silence;
  }
}

// How unlikely it is that nothing has been reported by t.
Inconsistency TimingFilter::overdue(const TimingState& state, Instant t) {
  const Covariance& from = slot(state.instants);
  if (from.instants != state.instants) return {};
  from.mean.flow->propagate(from.mean, t, sample_);
  bool suspect = false;
  for (int i = 0; i < flows_->dynamics().contacts(); ++i) {
    const bool held = contains(sample_.flow->locked(), i);
    if (contains(state.inside, i) || (contains(closed(state), i) && !held)) continue;
    const Signal& margin = held ? sample_.flow->force(i) : sample_.flow->gap(i);
    suspect = suspect || value(margin, sample_) < 0.0;
  }
  if (!suspect) return {};
  // The mean goes on from behind what was reported, even where that is still to come.
  const ContactSet recently = recently_reported(state, t);
  ContactSet unsettled = recently;
  if (unknown_time_ && take_so_far(state, t, unsettled)) {
    sample_ = published_;
  } else {
    load(from, t);
    sample_.flow->state(sample_, now_.q, now_.u);
  }
  const UncertainEvent due = next_due(state, sample_, {.done = recently}, 0).event;
  if (due.kind == UncertainEvent::Kind::none) return {};
  const double log_probability =
      unknown_time_ ? unknown_time_->log_of_silence(due, sample_, state.terms, now_)
                    : log_normal_cdf(value(sample_.flow->gap(due.contact), sample_) /
                                     deviation_of_gap(due.contact, state));
  return {t.hi, due.contact, Suspicion::missing_event, -2.0 * log_probability};
}

void TimingFilter::output_deviations(const TimingState& state,
                                     Eigen::Ref<Eigen::VectorXd> outputs) {
  if (outputs.size() == 0) return;
  if (state.unknown || state.inside != 0 || scale_is_open_) {
    outputs.setConstant(infinity);
    return;
  }
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  const std::vector<Output>& wanted = flows_->dynamics().model().outputs;
  for (Eigen::Index k = 0; k < outputs.size(); ++k) {
    const Output& of = wanted[static_cast<std::size_t>(k)];
    const double largest = of.velocity ? state.terms.speed : state.terms.length;
    const Eigen::MatrixXd& S = of.velocity ? now_.S_u : now_.S_q;
    double variance =
        square(measurement_rounding * largest / largest_w_) * of.direction.squaredNorm();
    for (Eigen::Index j = 0; j < now_.columns; ++j) variance += square(of.direction.dot(S.col(j)));
    outputs[k] = std::sqrt(variance);
  }
}

TimingFilter::LastFlight TimingFilter::last_flight(int contact, const TimingState& state) {
  constexpr int samples = 64;
  LastFlight flight;
  if (state.instants < 1) return flight;
  const Covariance& from = slot(state.instants - 1);
  if (from.instants != state.instants - 1 || from.mean.flow == nullptr ||
      contains(from.mean.flow->locked(), contact)) {
    return flight;
  }
  const double tau = state.covariance_time - from.mean.t;
  for (int i = 1; i < samples; ++i) {
    from.mean.flow->propagate(from.mean, from.mean.t + tau * i / samples, sample_);
    const double gap = value(from.mean.flow->gap(contact), sample_);
    if (gap < 0.0) flight.inside += 1.0 / samples;
    flight.lowest = std::min(flight.lowest, gap);
  }
  return flight;
}

bool TimingFilter::belief(const TimingState& state, double ahead, Belief& belief) {
  if (state.unknown || scale_is_open_ || state.inside != 0 || !remembers(state)) return false;
  load(state, tick_instant(state.tick, h_));
  state.motion.flow->state(state.motion, now_.q, now_.u);
  const Eigen::Index known = now_.columns;
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  belief = {now_.q, now_.u, Eigen::MatrixXd::Zero(f(), known + of_drift + 2),
            Eigen::MatrixXd::Zero(f(), known + of_drift + 2), known};
  belief.S_q.leftCols(known) = now_.S_q.leftCols(known);
  belief.S_u.leftCols(known) = now_.S_u.leftCols(known);
  if (ahead > 0.0) add_drift(uncertainty_, ahead, belief);
  belief.S_q.col(belief.columns++)
      .setConstant(measurement_rounding * state.terms.length / largest_w_);
  belief.S_u.col(belief.columns++)
      .setConstant(measurement_rounding * state.terms.speed / largest_w_);
  return is_sane(belief);
}

Eigen::MatrixXd TimingFilter::covariance(const TimingState& state) {
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  Eigen::MatrixXd S(2 * f(), now_.columns);
  S << now_.S_q.leftCols(now_.columns), now_.S_u.leftCols(now_.columns);
  return product(S, S.transpose());
}

Confidence TimingFilter::no_confidence() const {
  Confidence confidence;
  confidence.has_filter = confidence.from_filter = true;
  confidence.sigma_q.setZero(f());
  confidence.sigma_u.setZero(f());
  confidence.sigma_g.setZero(flows_->dynamics().contacts());
  confidence.sigma_outputs.setZero(std::ssize(flows_->dynamics().model().outputs));
  return confidence;
}

void TimingFilter::confidence(const TimingState& state, double, Confidence& confidence) {
  note(state, confidence);
  deviations(state, confidence.sigma_q, confidence.sigma_u, confidence.sigma_g);
  output_deviations(state, confidence.sigma_outputs);
}

void TimingFilter::note(const TimingState& state, Confidence& confidence) const {
  confidence.remembered = remembers(state);
  confidence.forgotten = state.forgotten;
  confidence.filter = state.innovation;
  confidence.inconsistencies = state.silences + state.lost;
  confidence.last = state.last;
  confidence.redundancy = state.redundancy;
  confidence.refused_impacts = state.refused_impacts;
}

}  // namespace sprag
