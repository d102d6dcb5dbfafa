#include "sprag/detail/bound/bound_tracker.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Whether an impact on one contact does not change the other's gap velocity.
bool are_uncoupled(const Eigen::MatrixXd& G, int a, int b) {
  return std::abs(G(a, b)) <= 1e-12 * std::sqrt(G(a, a) * G(b, b));
}

// Whether joint impacts gain no energy for all restitutions within the tolerance: they are
// nonexpansive, or |E Lambda_C| <= |Lambda_C|.
bool gains_nothing(const Dynamics& dynamics, bool monotone, double off) {
  if (dynamics.contacts() == 1 || (monotone && off == 0.0)) return true;
  const ContactSet all = bit(dynamics.contacts()) - 1;
  const double epsilon = largest_change(dynamics.model()) + off;
  if (joint_expansion(dynamics.G(), all, epsilon) <= 1.0) return true;
  return monotone &&
         largest_change(dynamics.model()) + off * restitution_spread(dynamics.G(), all) <= 1.0;
}

}  // namespace

struct BoundTracker::Impact : ImpactContacts {
  ContactSet leaving = 0;
  int contact = -1;  // of a single event; -1: several
  ContactEventKind kind = ContactEventKind::pulse;
  std::size_t count = 0;
  double t = 0.0;
  double epsilon = 0.0;  // largest_change() of the participating contacts
};

BoundTracker::BoundTracker(const Scene& scene, Flows& flows, double h,
                           const BoundSettings& settings)
    : tolerance_(scene.prior.tolerance),
      factors_(settings.factors),
      metric_(flows.dynamics()),
      contraction_(flows, scene.prior.tolerance),
      defect_(metric_, scene.prior.tolerance),
      cap_(metric_, scene.prior.tolerance),
      remainder_(metric_),
      first_order_(metric_, defect_, flows[0], scene.prior.tolerance),
      use_first_order_(settings.first_order && first_order_.exists() &&
                       !has_curves(flows.dynamics().model())),
      replica_(std::shared_ptr<Flows>(std::shared_ptr<void>(), &flows), h),
      start_(scene.prior.start),
      initial_(scene.prior.uncertainty.size() > 0 ? scene.prior.uncertainty.sum() : infinity),
      law_(law_is_masters(flows.dynamics().model())),
      monotone_(law_is_monotone(flows.dynamics().model())),
      joint_is_unlimited_(!monotone_ && has_curves(flows.dynamics().model()) &&
                          flows.dynamics().model().law == ImpactLaw::poisson),
      in_(std::sqrt(1.0 + scene.prior.tolerance.stiffness)),
      out_(1.0 / std::sqrt(1.0 - scene.prior.tolerance.stiffness)) {
  cap_holds_ = law_ && cap_.exists() &&
               gains_nothing(flows.dynamics(), monotone_, scene.prior.tolerance.restitution);
  const Eigen::Index f = metric_.coordinates();
  for (Eigen::VectorXd* x : {&modal_.z, &modal_.v, &modal_.acceleration, &q_, &u_}) x->setZero(f);
  flows[0].enter(start_.q, start_.u, at(0.0), no_gaps_, path_);
  free_ = before_ = path_;
  start(0, 0);
}

void BoundTracker::start(std::int64_t k, ContactSet chi) {
  replica_.start(start_, k, chi, state_);
  consumed_ = 0;
  gap_ = 0;
  failed_ = !law_;
  const double t = state_.motion.t.hi;
  metric_.enter(start_.q, start_.u, modal_);
  remainder_.start(state_.motion, modal_, chi);
  const double start_b = std::sqrt(initial_);
  W_ = cap_holds_ ? cap_.from_distance(start_b, modal_, 0.0) : infinity;
  if (k != 0 && cap_holds_) W_ = cap_.at_any_later_time(W_);
  // Without an uncertainty the machine is assumed to be within its ultimate bound.
  if (initial_ == infinity && cap_holds_) W_ = cap_.ultimate();
  W_t_ = since_ = integrated_to_ = followed_ = t;
  integral_ = 0.0;
  b_ = k == 0 ? in_ * start_b : infinity;
  // An event before a later start may be reported after it.
  lost_until_ = k == 0 ? t : t + tolerance_.time;
  cluster_.begin(b_, t);
  node_is_known_ = false;
  first_order_.stop();
}

double BoundTracker::known_up_to(const EventHistory& events) const {
  return std::min(events.horizon(), end_) - tolerance_.time;
}

// Reported times are rounded, so that machine and replica may differ by an impact for a moment also
// without a tolerance.
double BoundTracker::half_window(double t) const {
  return tolerance_.time + time_share_of_rounding * std::abs(t);
}

void BoundTracker::follow(const EventHistory& events, double t) {
  const double reach = std::min(t, known_up_to(events));
  if (reach < followed_) return;
  followed_ = reach;
  const double last = reach + half_window(reach);
  const std::span<const ContactEvent> all(events.events());
  const auto first =
      static_cast<std::size_t>(std::max<std::int64_t>(consumed_ - events.dropped(), 0));
  std::size_t end = first;
  while (end < all.size() && all[end].t <= last) ++end;
  for_each_instant(all.subspan(first, end - first), [&](std::span<const ContactEvent> of_one) {
    pass_gaps(events, of_one.front().t - tolerance_.time);
    event(of_one);
  });
  consumed_ = static_cast<std::int64_t>(end) + events.dropped();
  pass_gaps(events, reach);
}

// Passes the gaps that begin before t. Within a gap, widened by the tolerance on both sides, b is
// unknown. At the beginning of a gap b is still known: the lost events are later.
void BoundTracker::pass_gaps(const EventHistory& events, double t) {
  const std::vector<DegradedInterval>& gaps = events.degraded();
  while (gap_ < gaps.size()) {
    const DegradedInterval& gap = gaps[gap_];
    if (gap.start == events.start()) {
      const double from = gap.from - tolerance_.time;
      if (from >= t) return;
      if (b_ < infinity && from >= since_) advance(from);
      b_ = infinity;
      first_order_.stop();
      lost_until_ = std::max(lost_until_, gap.to + tolerance_.time);
      if (gap.to + tolerance_.time >= t) return;
    }
    ++gap_;
  }
}

// Sets modal_ to the replica's state at t, not before its last event. With closed contacts the
// replica itself moves to t.
void BoundTracker::take_state(double t) {
  const Instant instant = at(t);
  const Motion* motion = &state_.motion;
  if (state_.chi != 0) {
    if (instant - state_.motion.t > 0.0) replica_.advance(instant, state_);
  } else if (instant - state_.motion.t > 0.0) {
    state_.motion.flow->propagate(state_.motion, instant, path_);
    motion = &path_;
  }
  motion->flow->state(*motion, q_, u_);
  metric_.enter(q_, u_, modal_);
  metric_.accelerate(*motion, modal_);
}

// Integrates the defect from integrated_to_ to t, with no event in between.
void BoundTracker::integrate(double t) {
  if (state_.chi == 0) start_first_order(t);
  if (!defect_.any() || t < integrated_to_) return;
  const bool free = state_.chi == 0;
  if (!node_is_known_) {
    take_state(integrated_to_);
    node_ = defect_.node(modal_, integrated_to_, free);
    if (first_order_.active()) first_order_.look(modal_, node_, integrated_to_);
    node_is_known_ = true;
  }
  while (integrated_to_ < t) {
    const double next = std::min(t, integrated_to_ + defect_.longest_step());
    const double duration = next - integrated_to_;
    if (!(duration > 0.0)) break;
    take_state(next);
    const DefectNode node = defect_.node(modal_, next, free);
    integral_ +=
        free ? defect_.free_step(node_, node, duration) : defect_.closed_step(node_, duration);
    if (first_order_.active()) first_order_.step(modal_, node, next);
    node_ = node;
    integrated_to_ = next;
  }
}

// Moves b to t, at or after the end of all windows, and limits b and W by each other.
void BoundTracker::advance(double t) {
  if (b_ < infinity) {
    integrate(t);
    const double sigma = state_.chi == 0 ? contraction_(t - since_) : 1.0;
    b_ = sigma * b_ + integral_;
    if (first_order_.active()) {
      b_ = std::min(b_, first_order_.distance(sigma, t));
      first_order_.settle(sigma, t);
    }
  }
  integral_ = 0.0;
  since_ = t;
  if (integrated_to_ != t) node_is_known_ = false;
  integrated_to_ = t;
  limit_by_cap(t);
}

void BoundTracker::limit_by_cap(double t) {
  if (!cap_holds_ || failed_) return;
  if (b_ == infinity && t < lost_until_) return;
  take_state(t);
  double W = cap_.advance(W_, t - W_t_);
  if (const double by_b = cap_.from_distance(b_ * out_, modal_, t); by_b <= W) {
    W_ = W = by_b;
    W_t_ = t;
  }
  b_ = std::min(b_, in_ * cap_.distance(W, modal_, t));
}

// Starts the first-order set at the end of the last window, in free flight. Restarts it if b alone
// is smaller.
void BoundTracker::start_first_order(double t) {
  if (!use_first_order_ || b_ == infinity || integrated_to_ != since_ || t < since_) return;
  if (first_order_.active() && first_order_.rest(1.0, since_) < b_) return;
  take_state(since_);
  first_order_.start(b_, q_, u_, since_);
  node_is_known_ = false;
}

BoundTracker::Impact BoundTracker::impact_of(std::span<const ContactEvent> of_one_instant) const {
  const Model& model = metric_.dynamics().model();
  Impact impact;
  impact.before = impact.after = state_.chi;
  impact.count = of_one_instant.size();
  impact.t = of_one_instant.front().t;
  for (const ContactEvent& event : of_one_instant) {
    impact.after = sprag::after(impact.after, event);
    (event.kind == ContactEventKind::opens ? impact.leaving : impact.closing) |= bit(event.contact);
    if (event.kind == ContactEventKind::closes) impact.staying |= bit(event.contact);
  }
  impact.contact = of_one_instant.front().contact;
  impact.kind = of_one_instant.front().kind;
  for_each(impact.before | impact.closing, [&](int i) {
    impact.epsilon = std::max(impact.epsilon, largest_change(model.contacts[index(i)]));
  });
  return impact;
}

// Whether no other contact is closed, and all open windows of other contacts are simple impacts
// that do not affect this contact.
bool BoundTracker::is_alone(const Impact& impact) const {
  if (impact.count != 1 || (impact.before & ~bit(impact.contact)) != 0) return false;
  const auto allows = [&](const OpenWindow& other) {
    return other.contact == impact.contact ||
           (other.simple && impact.kind == ContactEventKind::pulse &&
            are_uncoupled(metric_.dynamics().G(), impact.contact, other.contact));
  };
  return std::all_of(cluster_.windows.begin(),
                     cluster_.windows.begin() + static_cast<std::ptrdiff_t>(cluster_.open), allows);
}

void BoundTracker::event(std::span<const ContactEvent> of_one_instant) {
  const Impact impact = impact_of(of_one_instant);
  const double delta = tolerance_.time;
  const double opens = impact.t - half_window(impact.t);
  if (opens >= since_ && opens >= lost_until_ && !failed_) {
    advance(opens);
    cluster_.begin(b_, impact.t);
  } else {
    first_order_.stop();
  }
  if (state_.chi == 0 && at(impact.t) - state_.motion.t > 0.0) {
    state_.motion.flow->propagate(state_.motion, at(impact.t), state_.motion);
  }
  take_state(impact.t);
  const double remainder = remainder_.of(impact, state_.motion, modal_);
  const bool alone = is_alone(impact);
  // Poisson's law with restitutions by speed: no limit is known for impacts of several contacts.
  if (!alone && joint_is_unlimited_ && impact.closing != 0) {
    first_order_.stop();
    b_ = infinity;
  }
  if (failed_ || b_ == infinity) {
    take_unbounded(of_one_instant);
    return;
  }
  cluster_.close_windows(opens);
  ++cluster_.events;
  if (first_order_.active()) first_order_.arrive(modal_, impact.t);
  const double speed_before = speed(metric_, modal_);
  const double density = defect_.any() ? defect_.node(modal_, impact.t, false).density : 0.0;
  const double rho = cluster_.growth * std::exp(2.0 * delta * metric_.damping()) * cluster_.moved();
  before_ = state_.motion;
  if (alone) take_free_branch(impact);
  replica_.take(of_one_instant, state_);
  take_state(impact.t);
  const double fastest = std::max(speed_before, speed(metric_, modal_));
  double defect = 0.0;
  if (defect_.any()) {
    const double after = defect_.node(modal_, impact.t, false).density;
    defect = std::max(density, after) + defect_.lipschitz() * 2.0 * delta * fastest;
    cluster_.R += 2.0 * delta * (defect + defect_.lipschitz() * rho);
  }
  cluster_.rounding += remainder;
  if (!alone) {
    first_order_.stop();
    joint(impact, rho, speed_before, speed(metric_, modal_));
  } else if (impact.kind == ContactEventKind::opens) {
    first_order_.stop();
    opening(impact, rho, fastest);
  } else {
    const Approach near = approach(free_, impact.contact, delta);
    const EventCost cost = single(impact, near, rho);
    pass_first_order(impact, near, cost, defect);
  }
  conclude(impact.t);
}

// Maps the first-order set through an impact whose window overlaps no earlier window. The set stops
// otherwise, also when a later window overlaps.
void BoundTracker::pass_first_order(const Impact& impact, const Approach& near,
                                    const EventCost& cost, double defect) {
  if (!first_order_.active()) return;
  const bool holds =
      impact.kind == ContactEventKind::pulse && impact.before == 0 && cluster_.events == 1 &&
      first_order_.impact({.contact = impact.contact,
                           .epsilon = impact.epsilon,
                           .t = impact.t,
                           .near = near,
                           .gamma = value(free_.flow->gap_velocity(impact.contact), free_),
                           .gamma_rate = rate(free_.flow->gap_velocity(impact.contact), free_),
                           .defect = defect,
                           .shift = cost.D + cost.E,
                           .rounding = cluster_.rounding},
                          factors_.D, factors_.E);
  if (!holds) first_order_.stop();
}

// Event while b is infinite: only the replica takes it. b can become finite again after the event's
// window.
void BoundTracker::take_unbounded(std::span<const ContactEvent> of_one_instant) {
  const double end = of_one_instant.front().t + half_window(of_one_instant.front().t);
  replica_.take(of_one_instant, state_);
  lost_until_ = std::max(lost_until_, end);
  since_ = integrated_to_ = std::max(since_, end);
  integral_ = 0.0;
  node_is_known_ = false;
}

// Sets free_ to the motion just before the event, on the flow without closed contacts.
void BoundTracker::take_free_branch(const Impact& impact) {
  if (before_.flow->locked() == 0) {
    free_ = before_;
    return;
  }
  before_.flow->state(before_, q_, u_);
  replica_.flows()[0].enter(q_, u_, at(impact.t), no_gaps_, free_);
}

// Sets b to its value after all events of the cluster, the last of them at t.
void BoundTracker::conclude(double t) {
  const double end = t + half_window(t);
  double D = cluster_.D;
  if (metric_.dynamics().contacts() == 1) {
    D = cluster_.shift(metric_.dynamics().G()(0, 0), metric_.omega_gamma(0), end, tolerance_.time);
  }
  b_ = cluster_.growth *
       (cluster_.start_b + in_ * (D + cluster_.swap + cluster_.E + cluster_.rounding) + cluster_.R);
  since_ = integrated_to_ = end;
  integral_ = 0.0;
  node_is_known_ = false;
  if (state_.refused_impacts > 0) {
    b_ = lost_until_ = infinity;
  } else if (b_ == infinity) {
    lost_until_ = std::max(lost_until_, end);
  }
}

void BoundTracker::add(const Impact& impact, const EventCost& cost) {
  cluster_.D += factors_.D * cost.D;
  cluster_.E += factors_.E * cost.E;
  const bool simple = impact.kind == ContactEventKind::pulse && impact.count == 1;
  if (!cluster_.add({.end = impact.t + half_window(impact.t),
                     .J = in_ * factors_.J * cost.J,
                     .contact = impact.count == 1 ? impact.contact : -1,
                     .simple = simple && impact.before == 0})) {
    cluster_.growth = infinity;
  }
}

EventCost BoundTracker::single(const Impact& impact, const Approach& near, double rho) {
  const Eigen::MatrixXd& G = metric_.dynamics().G();
  const int i = impact.contact;
  const double G_i = G(i, i);
  const bool stays = impact.kind == ContactEventKind::closes;
  const double epsilon = stays ? 0.0 : impact.epsilon;
  const EventCost cost =
      single_cost(metric_, tolerance_, stays ? SingleEvent::closes : SingleEvent::impact, i,
                  epsilon, near, rho);
  const double gamma = value(free_.flow->gap_velocity(i), free_);
  cluster_.impulse += (1.0 + epsilon) * std::max(0.0, -gamma) / G_i;
  cluster_.acceleration = std::max(cluster_.acceleration,
                                   near.rate + metric_.omega_D(i) * (1.0 + epsilon) * near.fastest);
  if (cluster_.events == 1) cluster_.first_speed = std::max(near.fastest, near.highest);
  add(impact, cost);
  return cost;
}

void BoundTracker::opening(const Impact& impact, double rho, double fastest) {
  const int i = impact.contact;
  const double delta = tolerance_.time;
  const double free_acceleration = rate(free_.flow->gap_velocity(i), free_);
  // Largest speed of both branches through the event, over the window.
  const double speed =
      std::exp(2.0 * delta * metric_.damping()) *
          std::hypot(fastest, free_acceleration / std::sqrt(2.0 * metric_.dynamics().G()(i, i))) +
      2.0 * delta * metric_.jerk();
  const EventCost cost = opening_cost(metric_, tolerance_, i, free_acceleration, speed, rho);
  const Approach near = approach(free_, i, delta);
  cluster_.acceleration = std::max(cluster_.acceleration, near.rate);
  if (cluster_.events == 1) cluster_.first_speed = std::max(near.fastest, near.highest);
  add(impact, cost);
}

// Event with several contacts, with other contacts closed, or with overlapping windows of such
// events. The path's speed bounds the effect of a time shift, projections bound the impacts.
void BoundTracker::joint(const Impact& impact, double rho, double speed_before,
                         double speed_after) {
  const double delta = tolerance_.time;
  const double widest = std::exp(2.0 * delta * metric_.damping());
  const double drift = 2.0 * delta * metric_.jerk() + metric_.support_step();
  const double before = widest * speed_before + drift;
  const double after = widest * speed_after + drift;
  ContactSet taking_part = impact.before | impact.closing | impact.leaving;
  double jumps = 0.0;
  int pairs = delta > 0.0 ? static_cast<int>(impact.count * (impact.count - 1) / 2) : 0;
  for (std::size_t k = 0; k < cluster_.open; ++k) {
    const OpenWindow& other = cluster_.windows[k];
    if (other.contact == impact.contact && impact.count == 1) continue;
    if (other.contact >= 0) taking_part |= bit(other.contact);
    jumps += other.J;
    ++pairs;
  }
  const ContactVector gamma = gap_velocities(taking_part, before_);
  const Eigen::MatrixXd& G = metric_.dynamics().G();
  const double reach = distance_to_rest(G, taking_part, gamma) + delta * before + rho;
  const double epsilon = largest_change(metric_.dynamics().model());
  double off = 0.0;
  if (tolerance_.restitution > 0.0 && impact.closing != 0) {
    off = tolerance_.restitution * restitution_spread(G, taking_part);
    if (!monotone_) off = std::max(off, tolerance_.restitution * contact_coupling(G, taking_part));
  }
  const double expansion =
      monotone_ ? 1.0 : joint_expansion(G, taking_part, epsilon + tolerance_.restitution);
  // |Z y - y| is at most this times the distance of y to a state that the impact does not change.
  const double kept = monotone_ ? 1.0 + epsilon : 1.0 + expansion;
  EventCost cost;
  cost.D = delta * (expansion * (before + metric_.rate() * rho) + after + metric_.rate() * rho);
  if (impact.closing != 0) {
    cost.J = (kept + off) * reach;
    cost.E = monotone_ ? off * reach : off * kept * reach;
  }
  cluster_.growth *= monotone_ ? 1.0 + off : expansion;
  // Two impacts in either order or at once: |E_b E_a y - y| + |Z_ab y - y| is at most (3 + kept)
  // kept times the distance of y, before both, to the nearest state with gamma >= 0.
  const double either = (3.0 + kept) * kept;
  cluster_.swap += either * (pairs * (reach + 2.0 * delta * before) + jumps);
  add(impact, cost);
}

double BoundTracker::bound(const EventHistory& events, double t, const Eigen::VectorXd& q,
                           const Eigen::VectorXd& u) {
  const double known = known_up_to(events);
  if (failed_ || t < followed_ || t > known + time_share_of_rounding * std::abs(known))
    return infinity;
  double b = infinity;
  if (b_ < infinity && t <= since_) {
    b = b_ + cluster_.open_J(t);
  } else if (b_ < infinity) {
    integrate(t);
    const double sigma = state_.chi == 0 ? contraction_.at_node(t - since_) : 1.0;
    b = sigma * b_ + integral_;
    if (first_order_.active()) b = std::min(b, first_order_.distance(sigma, t));
  }
  if (cap_holds_) {
    const double W = cap_.advance(W_, t - W_t_);
    if (b > in_ * cap_.least_distance(W)) {
      metric_.enter(q, u, modal_);
      b = std::min(b, in_ * cap_.distance(W, modal_, t));
    }
  }
  // Rounding of the replica's state. The root of its energy grows by the forces alone.
  const double since_event = std::max(t - since_, 0.0) + 2.0 * tolerance_.time;
  const double moving = std::sqrt(remainder_.energy()) + metric_.push() * since_event;
  return square(out_ * (b + state_share_of_rounding * (b + moving)));
}

std::string why_no_bound(const Scene& scene) {
  if (!law_is_masters(scene.model)) return "the replica has a restitution of its own";
  if (scene.prior.uncertainty.size() > 0) return {};
  const Dynamics dynamics(scene.model);
  const EnergyMetric metric(dynamics);
  if (!DissipationCap(metric, scene.prior.tolerance).exists()) {
    return "replica.uncertainty is not given, and C or K is singular";
  }
  if (!gains_nothing(dynamics, law_is_monotone(scene.model), scene.prior.tolerance.restitution)) {
    return "replica.uncertainty is not given, and joint impacts may gain energy";
  }
  return {};
}

}  // namespace sprag
