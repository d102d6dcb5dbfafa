#include "sprag/detail/replica/replica.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Largest number of clutch switchings in one interval. The rest of the interval then has none.
constexpr int max_switchings = 1000;

}  // namespace

Replica::Replica(Model model, double h) : Replica(std::make_shared<Flows>(std::move(model)), h) {}

Replica::Replica(std::shared_ptr<Flows> flows, double h)
    : flows_(std::move(flows)), h_(h), solver_(*flows_, DependentContacts::share) {
  build_foreseeable(*flows_);
  flight_ = TickedFlight((*flows_)[0], h);
  const auto m = index(flows_->dynamics().contacts());
  order_.assign(m, 0);
  epsilon_.assign(m, 0.0);
  watches_.reserve(m);
  search_.reserve(m, (*flows_)[0].size());
}

void Replica::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                    ReplicaState& state) {
  state.tick = k;
  state.chi = chi;
  state.idle = 0;
  state.redundancy = {};
  state.refused_impacts = 0;
  state.innovation = {};
  if (recorder_ != nullptr) recorder_->start();
  solver_.start(start, tick_instant(k, h_), state.motion);
  if (chi != 0) {
    std::fill(epsilon_.begin(), epsilon_.end(), 0.0);
    const Collision collision = solver_.collide(chi, epsilon_, chi, 0, state.motion);
    if (collision.solved != Solved::yes) ++state.refused_impacts;
    note_idle(chi, collision.unsatisfied, state);
  }
  TickedFlight::set_anchor(state.motion, state.anchor);
}

void Replica::tick_through(std::span<const ContactEvent> events, ReplicaState& state) {
  open_tick(state);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) { take(of_one, state); });
  close_tick(state);
}

void Replica::open_tick(ReplicaState& state) const {
  state.motion.t = tick_instant(state.tick, h_);
  ++state.tick;
}

void Replica::take(std::span<const ContactEvent> of_one_instant, ReplicaState& state) {
  advance(at(of_one_instant.front().t), state);
  take_here(of_one_instant, state);
}

// Applies the events of the present instant and records them.
void Replica::take_here(std::span<const ContactEvent> events, ReplicaState& state) {
  if (recorder_ == nullptr) return apply_group(events, state);
  const ContactSet before = state.motion.flow->locked();
  q_.resize(flows_->dynamics().coordinates());
  u_.resize(q_.size());
  state.motion.flow->state(state.motion, q_, u_);
  recorder_->before(u_);
  apply_group(events, state);
  ContactSet struck = before | state.motion.flow->locked();
  for (const ContactEvent& event : events) {
    if (event.kind != ContactEventKind::opens) struck |= bit(event.contact);
  }
  state.motion.flow->state(state.motion, q_, u_);
  recorder_->after(u_, events.front().t, struck, events);
}

// Moves on the present flow to t.
void Replica::fly(Instant t, Motion& motion) {
  if (recorder_ != nullptr) recorder_->fly(motion, t - motion.t);
  motion.flow->propagate(motion, t, motion);
}

void Replica::close_tick(ReplicaState& state) {
  advance(tick_instant(state.tick, h_), state);
  TickedFlight::set_anchor(state.motion, state.anchor);
}

void Replica::apply(std::span<const ContactEvent> events, ReplicaState& state) {
  take_here(events, state);
  std::fill(order_.begin(), order_.end(), 0);
  TickedFlight::set_anchor(state.motion, state.anchor);
}

// Applies the events of one instant: one impact of the contacts that close, have a pulse or are
// closed.
void Replica::apply_group(std::span<const ContactEvent> events, ReplicaState& state) {
  const Model& model = flows_->dynamics().model();
  const ContactSet before = state.chi;
  ContactSet closing = 0;
  for (std::size_t i = 0; i < epsilon_.size(); ++i) {
    const Contact& contact = model.contacts[i];
    const double gamma =
        contact.curve.is_constant() ? 0.0 : solver_.gap_velocity(static_cast<int>(i), state.motion);
    epsilon_[i] = restitution_of_replica(contact, gamma);
  }
  for (const ContactEvent& event : events) {
    state.chi = after(state.chi, event);
    if (event.kind == ContactEventKind::opens) continue;
    closing |= bit(event.contact);
    if (event.kind == ContactEventKind::closes) epsilon_[index(event.contact)] = 0.0;
  }
  std::fill(order_.begin(), order_.end(), 0);
  if (closing == 0) {
    release(before & ~state.chi, 0, state);
    return;
  }
  note_innovation(closing, state);
  const Collision collision =
      solver_.collide(before | closing, epsilon_, state.chi, 0, state.motion);
  if (collision.solved != Solved::yes) {
    ++state.refused_impacts;
    release(before & ~state.chi, 0, state);
    return;
  }
  note_idle(closing, collision.unsatisfied, state);
  const ContactSet locked = state.motion.flow->locked();
  const ContactSet from_zero = (collision.resting & ~locked) | collision.unloaded;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    order_[i] = contains(from_zero, static_cast<int>(i)) ? 1 : 0;
  }
}

// Removes `leaving`, which open, and `unlocking`, which stay closed, from the locked set. Contacts
// that depended on them are then locked by themselves.
void Replica::release(ContactSet leaving, ContactSet unlocking, ReplicaState& state) {
  ContactSet carried = state.motion.flow->tied() & state.chi;
  ContactSet unsatisfied = solver_.release(leaving | unlocking, state.motion);
  carried &= ~state.motion.flow->tied();
  const ContactSet parting = solver_.parting(carried, state.motion);
  const ContactSet closed = state.chi & ~(unlocking | parting);
  for_each(unlocking | parting, [&](int i) { order_[index(i)] = 2; });
  if ((carried & ~parting) != 0 || solver_.pressed_in(closed & state.idle, state.motion) != 0) {
    std::fill(epsilon_.begin(), epsilon_.end(), 0.0);
    const Collision collision = solver_.collide(closed, epsilon_, closed, 0, state.motion);
    if (collision.solved != Solved::yes) ++state.refused_impacts;
    unsatisfied = collision.unsatisfied;
  }
  note_idle(0, unsatisfied, state);
}

// `closing`: contacts that have just closed; `unsatisfied`: result of the last change of the locked
// set.
void Replica::note_idle(ContactSet closing, ContactSet unsatisfied, ReplicaState& state) const {
  if (unsatisfied != 0) ++state.refused_impacts;
  const ContactSet tied = state.motion.flow->tied() & state.chi;
  state.idle = tied | (unsatisfied & state.chi);
  if ((tied & closing) == 0) return;
  ++state.redundancy.closings;
  state.redundancy.contact = std::countr_zero(tied & closing);
}

void Replica::note_innovation(ContactSet closing, ReplicaState& state) const {
  state.innovation = {state.motion.t.hi, -1, 0.0, 0.0};
  for_each(closing, [&](int i) {
    const double gap = solver_.gap(i, state.motion);
    if (state.innovation.contact >= 0 && std::abs(gap) <= std::abs(state.innovation.gap)) return;
    state.innovation.contact = i;
    state.innovation.gap = gap;
  });
}

void Replica::advance(Instant t, ReplicaState& state) {
  Motion& motion = state.motion;
  for (int switchings = 0; state.chi != 0 && switchings < max_switchings; ++switchings) {
    const ContactSet locked = motion.flow->locked();
    watches_.clear();
    for (int i = 0; i < static_cast<int>(order_.size()); ++i) {
      if (!contains(state.chi & ~state.idle, i)) continue;
      if (contains(locked, i)) {
        watches_.push_back({&motion.flow->force(i), 1.0, order_[index(i)], i});
      } else {
        watches_.push_back({&motion.flow->gap_velocity(i), 1.0, order_[index(i)], i});
      }
    }
    const double interval = t - motion.t;
    search_.begin(motion, watches_);
    search_.advance(interval);
    if (!search_.found() || search_.tau() > interval) break;

    ContactSet unlocking = 0;
    ContactSet locking = 0;
    for (std::size_t w = 0; w < watches_.size(); ++w) {
      if (!search_.fires(w)) continue;
      (contains(locked, watches_[w].id) ? unlocking : locking) |= bit(watches_[w].id);
    }
    fly(motion.t + search_.tau(), motion);
    std::fill(order_.begin(), order_.end(), 0);
    if (unlocking != 0) release(0, unlocking, state);
    if (locking == 0) continue;
    const Locking outcome = solver_.lock(motion.flow->locked() | locking, 0, motion);
    if (outcome.solved != Solved::yes) {
      ++state.refused_impacts;
      break;
    }
    note_idle(0, outcome.unsatisfied, state);
    // A contact that is pressed in and cannot be held stays idle until the next change.
    const ContactSet free = locking & ~motion.flow->locked();
    state.idle |= solver_.pressed_in(free, motion);
    for_each(free & ~state.idle, [&](int i) { order_[index(i)] = 1; });
    for (std::size_t i = 0; i < order_.size(); ++i) {
      if (contains(outcome.unloaded, static_cast<int>(i))) order_[i] = 1;
    }
  }
  if (t - motion.t > 0.0) fly(t, motion);
  // Resets the orders: a tick must depend on the state alone.
  std::fill(order_.begin(), order_.end(), 0);
}

void Replica::output(const ReplicaState& state, Eigen::Ref<Eigen::VectorXd> q,
                     Eigen::Ref<Eigen::VectorXd> u) const {
  state.motion.flow->state(state.motion, q, u);
}

Confidence Replica::no_confidence() const {
  Confidence confidence;
  confidence.has_replica = true;
  return confidence;
}

void Replica::note(const ReplicaState& state, Confidence& confidence) const {
  confidence.replica = state.innovation;
  confidence.redundancy = state.redundancy;
  confidence.refused_impacts = state.refused_impacts;
}

}  // namespace sprag
