#include "sprag/detail/filter/event_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/filter/flux.h"
#include "sprag/detail/filter/track.h"
#include "sprag/detail/filter/triangularize.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// find() and expect(): Gauss-Newton iteration on the time of an event. condense(): placements of
// its nodes.
constexpr int most_steps = 12;
constexpr double settled = 1e-2;      // tolerance, in deviations of the event time
constexpr double longest_step = 2.0;  // in sigma
// condense(): nodes around the most likely time.
constexpr double node_reach = 4.2;  // in deviations of the event time
constexpr int fewest_nodes = 5, most_nodes = 25;
constexpr double negligible = 1e-14;  // nodes below this weight are pruned
constexpr double most_share = 0.85;   // nodes move closer to a node of more weight
// scan() and burst(): times within node_reach sigma, about half a sigma apart.
constexpr int spread_nodes = 17;
// After a burst: mean and deviation of the contact's speed, in units of its speed before the burst.
constexpr double leaving_speed = 0.75, leaving_sigma = 0.6;

}  // namespace

EventFilter::EventFilter(Flight& flight, FilterModel model)
    : model_(std::move(model)), at_(flight, model_), published_(at_, no_belief()) {
  model_.considered.resize(static_cast<std::size_t>(unknowns()), false);
  const Eigen::Index bend = flight.bend().size() > 0 ? 1 : 0;
  const Eigen::Index columns = at_.event_columns() + bend;
  for (Eigen::VectorXd* of : {&offset_, &past_mean_, &point_.z}) of->setZero(at_.size());
  for (Eigen::VectorXd* of : {&x_, &kick_}) of->setZero(2 * n());
  for (Eigen::VectorXd* of : {&c_, &from_point_, &c_by_c_, &velocity_by_c_})
    of->setZero(unknowns());
  xi_.setZero(at_.A.cols());
  next_.setZero(at_.X.cols());
  unit_.setZero(at_.X.cols());
  nodes_.resize(most_nodes);
  for (Node& node : nodes_) {
    node.z.setZero(at_.size());
    node.jump.setZero(2 * n());
    node.columns.setZero(at_.size(), columns);
  }
  all_.setZero(at_.size(), most_nodes * (columns + 1));
  reflector_.setZero(all_.cols());
}

FilterBelief EventFilter::no_belief() const {
  FilterBelief belief;
  belief.z.setZero(at_.size());
  belief.S.setZero(at_.size(), at_.size());
  const auto m = flight().contacts();
  belief.reported.setConstant(m, -infinity);
  belief.occurred.setConstant(m, -infinity);
  belief.rebound.setZero(m);
  belief.impact.jump.setZero(2 * n());
  return belief;
}

void EventFilter::record_in(std::vector<FilterStep>* steps) {
  steps_ = steps;
  at_.keep_past(steps != nullptr);
  if (steps == nullptr) return;
  for (Node& node : nodes_) {
    node.past_mean.setZero(at_.size());
    node.past.setZero(at_.size(), node.columns.cols());
  }
  all_.setZero(2 * at_.size(), std::max(all_.cols(), 2 * at_.size()));
  reflector_.setZero(all_.cols());
}

// Twice the expected energy: that of the mean x and of the deviations at_.X.
double EventFilter::energy(const Eigen::VectorXd& x) const {
  return flight().twice_energy(x) + flight().twice_energy(at_.X);
}

// True if the hypothesis places a closing before the contact's last event. The gap is zero there as
// well, but it is no second impact.
bool EventFilter::precedes_last(const Event& event, double tau, const FilterBelief& belief) {
  return event.kind != Kind::opens && event.t - tau < belief.occurred[event.contact];
}

// Initial value of the Gauss-Newton steps where the likelihood may have several maxima: the best of
// several times, each after one Newton step. The gap, or the contact force at an opening, falls
// there.
void EventFilter::scan(const Event& event, const FilterBelief& belief) {
  const double sigma = belief.sigma;
  const double half = node_reach * sigma / (spread_nodes - 1);
  const bool opens = event.kind == Kind::opens;
  double least = infinity;
  for (int i = 0; i < spread_nodes; ++i) {
    double tau = node_reach * sigma * (2.0 * i / (spread_nodes - 1) - 1.0);
    at_.fly(event.t - tau, belief.z, belief);
    at_.look(event.contact, opens, event.t);
    double g = at_.of.g, v = at_.of.velocity;
    const double s2 = at_.phi.squaredNorm() + at_.noise;
    const double move = std::clamp(
        (g * v / s2 - tau / square(sigma)) / (1.0 / square(sigma) + square(v) / s2), -half, half);
    g -= v * move;
    tau += move;
    if (precedes_last(event, tau, belief)) continue;
    const double both = at_.phi.dot(at_.psi);
    const double mean = v - both / s2 * g;
    const double deviation =
        std::sqrt(std::max(at_.psi.squaredNorm() - square(both) / s2, square(1e-12 * v)));
    const double cost = square(tau / sigma) + square(g) / s2 + std::log(s2) -
                        2.0 * flux_moments(mean, deviation, 0.0).log_weight;
    if (!(cost < least)) continue;
    least = cost;
    xi_ = (-g / s2) * at_.phi.head(xi_.size());
    xi_tau_ = tau / sigma;
  }
}

// Finds the most likely event time by Gauss-Newton steps on (xi, tau / sigma), into point_.
bool EventFilter::find(const Event& event, FilterBelief& belief) {
  const double t = event.t, sigma = belief.sigma;
  const bool opens = event.kind == Kind::opens;
  xi_.setZero();
  xi_tau_ = 0.0;
  point_.z = belief.z;
  point_.grazes = false;
  const auto linearize = [&] {
    at_.fly(t - sigma * xi_tau_, point_.z, belief);
    at_.look(event.contact, opens, t);
  };
  const auto set_point = [&] {
    point_.z = belief.z;
    point_.z.noalias() += at_.A.lazyProduct(xi_);
    point_.tau = sigma * xi_tau_;
  };
  for (int step = 0; step < most_steps; ++step) {
    linearize();
    if (step == 0) {
      const double v = at_.of.velocity;
      if (!opens) {
        const double variance = at_.phi.squaredNorm() + square(v * sigma) + at_.noise + event.extra;
        belief.innovation = {t, event.contact, at_.of.g, std::sqrt(variance)};
        belief.length = std::max(belief.length, at_.of.length);
        belief.speed = std::max(belief.speed, std::abs(v));
      }
      const double margin = at_.psi.norm() + std::abs(at_.of.acceleration) * sigma;
      if (sigma > 0.0 && !(v < -node_reach * margin)) {
        scan(event, belief);
        point_.grazes = true;
        set_point();
        linearize();
      }
    }
    double noise = at_.noise + event.extra;
    if (!opens) {
      // Second-order variance: deviation of the time times deviation of the velocity given the gap.
      const double rest =
          at_.psi.squaredNorm() - square(at_.psi.dot(at_.phi)) / (at_.phi.squaredNorm() + noise);
      noise += square(sigma) * std::max(rest, 0.0);
    }
    const double of_time = -at_.of.velocity * sigma;
    const double variance = at_.phi.squaredNorm() + square(of_time) + noise;
    if (!(variance > 0.0) || !std::isfinite(variance)) return false;
    const Eigen::Index known = xi_.size();
    const double factor = (at_.phi.head(known).dot(xi_) + of_time * xi_tau_ - at_.of.g) / variance;
    const double move = sigma * (factor * of_time - xi_tau_);
    const double share = sigma * of_time / (variance * (1.0 + std::sqrt(noise / variance)));
    point_.spread = std::hypot(sigma - of_time * share, at_.phi.norm() * share);
    point_.square = square(factor) * (variance - noise);
    if (sigma == 0.0) {
      const double floor =
          square(contact_rounding * std::max(opens ? 0.0 : belief.length, at_.of.rounding));
      point_.square = square(factor) * square(variance) / (variance + floor);
    }
    point_.tau = sigma * xi_tau_;
    if (step > 0 && std::abs(move) <= settled * point_.spread + 2.0 * machine_epsilon * t) break;
    const double part = std::abs(move) < longest_step * sigma || sigma == 0.0
                            ? 1.0
                            : longest_step * sigma / std::abs(move);
    xi_ += part * (factor * at_.phi.head(known) - xi_);
    xi_tau_ += part * (factor * of_time - xi_tau_);
    set_point();
    if (!point_.z.allFinite()) return false;
    if (sigma == 0.0 && unknowns() == 0) break;  // the problem is linear
  }
  return true;
}

// Whether the belief separates this event from the contact's last one, although their reports are
// close. Never while recording: all passes of the smoother have the same steps.
bool EventFilter::resolves(const Event& event, FilterBelief& belief) {
  if (steps_ != nullptr) return false;
  at_.spread(belief, event.t - belief.t);
  if (!find(event, belief)) return false;
  const double apart = event.t - point_.tau - belief.occurred[event.contact];
  return apart > indistinct * belief.sigma && apart > certain * point_.spread;
}

// Finds the event time by the belief, linearized about the motion of `about`. Returns false if that
// motion has no event of the contact near the report, or one too close to grazing.
bool EventFilter::expect(const Event& event, const FilterBelief& about,
                         const FilterBelief& belief) {
  const bool opens = event.kind == Kind::opens;
  point_.z = about.z;
  flight().set(about.z.tail(unknowns()), false);
  flight().fly(about.z.head(2 * n()), about.t, belief.t - about.t, about.held);
  point_.z.head(2 * n()) = flight().x();
  // The event of the motion `about`, by Newton steps.
  double tau = 0.0;
  double step = infinity;
  for (int i = 0; i < most_steps && std::abs(step) > settled * belief.sigma; ++i) {
    at_.fly(event.t - tau, point_.z, belief);
    at_.look(event.contact, opens, event.t);
    step = std::clamp(at_.of.g / at_.of.velocity, -longest_step * belief.sigma,
                      longest_step * belief.sigma);
    if (!std::isfinite(step)) return false;
    tau += step;
  }
  at_.fly(event.t - tau, point_.z, belief);
  at_.look(event.contact, opens, event.t);
  // Near grazing the gap is not linear in the time.
  const double bent = node_reach * std::abs(at_.of.acceleration) * belief.sigma;
  if (!opens && !(at_.of.velocity < -bent)) return false;
  offset_ = belief.z - point_.z;
  at_.carry(offset_);
  const double residual = at_.of.g + at_.of.velocity * tau + at_.of_g.dot(at_.dx) +
                          at_.by_c.dot(offset_.tail(unknowns()));
  const double of_time = -at_.of.velocity * belief.sigma;
  const double variance = at_.phi.squaredNorm() + square(of_time) + at_.noise;
  if (!(variance > 0.0) || !std::isfinite(residual)) return false;
  point_.tau = -belief.sigma * of_time * residual / variance;
  point_.spread = belief.sigma * std::sqrt(std::max(1.0 - square(of_time) / variance, 0.0));
  point_.square = square(residual) / variance;
  return true;
}

// Weighs the component by sqrt(gamma^2 + a^2) where gamma < 0, a the gap's deviation over that of
// the report, and matches its mean and covariance along gamma to the moments of the weighted
// distribution. The weight is that of Jeffreys' prior for a report of the event time: the flux of
// the gap through the support where the state is known better than the time, the same for all gamma
// where it is not. With the flux alone the motion would grow from impact to impact.
void EventFilter::weigh_flux(double sigma, double variance, double& gamma, Node& node) {
  const double deviation = at_.psi.norm();
  if (!(deviation > 1e-6 * std::abs(gamma))) {
    node.log_weight += std::log(std::max(-gamma, 1e-300));
    return;
  }
  const double a = std::sqrt(variance) / sigma;
  // The weight at the mean, less |gamma| there.
  const double even = square(a) / (std::abs(gamma) + std::hypot(gamma, a));
  const FluxMoments moments = flux_moments(gamma, deviation, even);
  const double along = (moments.mean - gamma) / deviation;
  const double rest = std::sqrt(std::max(moments.variance, 1e-6 * square(deviation)));
  const double cut = 1.0 - rest / deviation;
  unit_ = at_.psi / deviation;
  at_.update_along(unit_, along, cut, x_, c_);
  at_.psi *= 1.0 - cut;
  node.log_weight += moments.log_weight;
  gamma = moments.mean;
}

// Computes one component of the Gaussian sum, for an event at t - node.tau: measurement update,
// flux, impact, and flight to the common time t - point_.tau.
void EventFilter::condition(const Event& event, const FilterBelief& belief, Node& node) {
  const double tau = node.tau;
  const double when = event.t - tau;
  const bool closes = event.kind != Kind::opens, exact = belief.sigma == 0.0;
  at_.fly(when, point_.z, belief);
  at_.look(event.contact, !closes, event.t);
  // Offset of the mean from the point of linearization.
  offset_ = belief.z - point_.z;
  at_.carry(offset_);
  x_ = at_.x + at_.dx;
  c_ = belief.z.tail(unknowns());
  const auto theta = point_.z.tail(unknowns());
  const double residual = at_.of.g + at_.of_g.dot(at_.dx) + at_.by_c.dot(offset_.tail(unknowns()));
  const double noise = at_.noise + event.extra;
  const double variance = at_.phi.squaredNorm() + noise;
  node.departs = 0.0;
  node.log_weight = -0.5 * (square(residual) / variance + std::log(variance));
  if (!exact) node.log_weight -= 0.5 * square(tau / belief.sigma);
  at_.measure(residual, noise, x_, c_);
  double gamma = 0.0;
  if (closes) {
    at_.psi.noalias() = at_.X.transpose().lazyProduct(at_.of_velocity);
    at_.psi.noalias() += at_.T.transpose().lazyProduct(at_.velocity_by_c);
    gamma = at_.of.velocity + at_.of_velocity.dot(x_) - at_.of_velocity.dot(at_.x) +
            at_.velocity_by_c.dot(c_ - theta);
    if (!exact && event.kind == Kind::impact)
      node.departs = square(std::max(gamma, 0.0) / at_.psi.norm());
    if (!exact && !at_.considers() && event.extra == 0.0)
      weigh_flux(belief.sigma, variance, gamma, node);
    if (exact && event.kind == Kind::stays) measure_rest(event, gamma);
  }
  node.gamma = gamma;
  node.gamma_sigma = at_.psi.norm();
  // Impact, and flight to the common time.
  Flight& on = flight();
  const Eigen::Index columns = at_.event_columns();
  const bool bends = node.columns.cols() > columns;
  on.set(theta, unknowns() > 0);
  on.fly(x_, when, 0.0, closes ? 0 : belief.held);
  node.columns.topLeftCorner(2 * n(), columns) = at_.X.leftCols(columns);
  node.columns.bottomLeftCorner(unknowns(), columns) = at_.T.leftCols(columns);
  if (bends) node.columns.col(columns).setZero();
  auto moved = node.columns.topRows(2 * n());
  if (closes) {
    node.held = on.strike(event.contact, event.kind == Kind::stays, belief.held, node.gamma_sigma);
    node.jump = on.x() - x_;
    on.carry_through(moved);
    if (bends) moved.col(columns) = on.bend();
    // Gap velocity immediately after the impact.
    on.differences(event.contact, false, c_by_c_, velocity_by_c_);
    node.after = on.gap(event.contact).velocity + velocity_by_c_.dot(c_ - theta);
    double seen = 0.0;
    for (Eigen::Index j = 0; j < moved.cols(); ++j) {
      seen += square(at_.of_velocity.dot(moved.col(j)) +
                     velocity_by_c_.dot(node.columns.col(j).tail(unknowns())));
    }
    node.after_sigma = std::sqrt(seen);
    if (exact) moved.col(columns - 1) += (measurement_rounding * event.t) * on.by_time();
  } else {
    node.held = released(event.contact, belief);
  }
  on.fly_on(tau - point_.tau, node.held);
  on.carry(moved);
  node.z.head(2 * n()) = on.x();
  node.z.tail(unknowns()) = c_;
  if (unknowns() > 0) {
    from_point_ = c_ - theta;
    node.z.head(2 * n()).noalias() += on.by_unknowns().lazyProduct(from_point_);
    moved.noalias() += on.by_unknowns().lazyProduct(node.columns.bottomRows(unknowns()));
  }
  if (steps_ == nullptr) return;
  node.past_mean = at_.past_mean;
  node.past.leftCols(columns) = at_.past.leftCols(columns);
}

// Variance of the gap velocity at the end of a completed chatter: the bounces that the master
// completes last up to chatter_time.
double EventFilter::remainder(const Event& event) {
  const double off = std::max(model_.chatter_time, measurement_rounding * event.t);
  flight().acceleration_gradient(event.contact, kick_);
  next_.noalias() = at_.X.transpose().lazyProduct(kick_);
  return square(off) * (square(at_.of.acceleration) + next_.squaredNorm());
}

// Variance of the gap at the end of a completed chatter, whose last bounces are not reported.
double EventFilter::variance_of_unreported(const Event& event) {
  if (!(flight().restitution(event.contact) > 0.0)) return 0.0;
  const double fallen = square(at_.of.velocity) + at_.psi.squaredNorm();
  return 0.25 * square(model_.chatter_time) * (remainder(event) + fallen);
}

// Measures gamma = 0 at the end of a completed chatter. Does nothing if gamma is already known
// about as accurately, and on machines with several contacts, which may have wedged each other.
void EventFilter::measure_rest(const Event& event, double gamma) {
  if (flight().contacts() > 1 || !(flight().restitution(event.contact) > 0.0)) return;
  const double left = remainder(event);
  if (!(at_.psi.squaredNorm() > left)) return;
  at_.phi = at_.psi;
  at_.measure(gamma, left + square(measurement_rounding * at_.of.velocity), x_, c_);
}

// Contacts that remain held after `contact` opens.
ContactSet EventFilter::released(int contact, const FilterBelief& belief) const {
  const ContactSet others = ~bit(contact);
  return flight().independent(belief.held & others, belief.closed & others);
}

// Moment matching: collapses the nodes to one Gaussian. Replaces log_weight of each node by its
// normalized weight.
void EventFilter::collapse(double largest, int nodes, FilterBelief& belief) {
  double total = 0.0;
  for (int i = 0; i < nodes; ++i) {
    double& weight = nodes_[index(i)].log_weight;
    weight = std::exp(weight - largest);
    total += weight;
  }
  const bool records = steps_ != nullptr;
  const Eigen::Index size = at_.size();
  belief.z.setZero();
  past_mean_.setZero();
  for (int i = 0; i < nodes; ++i) {
    Node& node = nodes_[index(i)];
    node.log_weight /= total;
    belief.z += node.log_weight * node.z;
    if (records) past_mean_ += node.log_weight * node.past_mean;
  }
  Eigen::Index columns = 0;
  for (int i = 0; i < nodes; ++i) {
    const Node& node = nodes_[index(i)];
    if (node.log_weight < negligible) continue;
    const double root = std::sqrt(node.log_weight);
    for (Eigen::Index j = 0; j < node.columns.cols(); ++j) {
      all_.col(columns).head(size) = root * node.columns.col(j);
      if (records) all_.col(columns).tail(size) = root * node.past.col(j);
      if (all_.col(columns).squaredNorm() > 0.0) ++columns;
    }
    if (nodes == 1) continue;
    all_.col(columns).head(size) = root * (node.z - belief.z);
    if (records) all_.col(columns).tail(size) = root * (node.past_mean - past_mean_);
    ++columns;
  }
  keep(columns, belief);
}

// Triangularizes the columns in all_ into the belief's S and, while recording, into a new step.
void EventFilter::keep(Eigen::Index columns, FilterBelief& belief) {
  const Eigen::Index size = at_.size(), end = steps_ != nullptr ? 2 * size : size;
  while (columns < end) all_.col(columns++).setZero();
  triangularize(all_, 0, end, columns, reflector_);
  belief.S = all_.topLeftCorner(size, size);
  if (steps_ == nullptr) return;
  steps_->push_back({belief, -1, past_mean_, all_.block(size, 0, size, size),
                     all_.block(size, size, size, size)});
}

// Conditions the belief on nodes around `center` within `reach`.
EventFilter::Placement EventFilter::place(const Event& event, double center, double reach,
                                          int nodes, const FilterBelief& belief) {
  Placement of{center, reach, -infinity};
  for (int i = 0; i < nodes; ++i) {
    Node& node = nodes_[index(i)];
    node.tau = center + reach * (nodes > 1 ? 2.0 * i / (nodes - 1) - 1.0 : 0.0);
    condition(event, belief, node);
    if (!(node.log_weight < infinity)) return {center, reach, -infinity};
    if (nodes > 1 && precedes_last(event, node.tau, belief)) {
      node.log_weight = -infinity;
    }
    if (node.log_weight > of.largest) of.heaviest = i;
    of.largest = std::max(of.largest, node.log_weight);
  }
  if (!std::isfinite(of.largest)) return of;
  for (int i = 0; i < nodes; ++i) of.total += std::exp(nodes_[index(i)].log_weight - of.largest);
  return of;
}

// Conditions the belief on nodes around point_.tau within `reach` and collapses them.
// If one node has nearly all the weight, the spacing does not resolve the posterior of the time:
// the nodes move to it, closer together. A peak may be so narrow that it has less mass than the
// nodes around it; then these are used, and the node on the peak gets the mass of the peak.
bool EventFilter::condense(const Event& event, double reach, int nodes, FilterBelief& belief) {
  std::array<Placement, most_steps> placed;
  std::size_t last = 0;
  placed[0] = place(event, point_.tau, reach, nodes, belief);
  while (nodes > 1 && last + 1 < placed.size() && std::isfinite(placed[last].largest) &&
         placed[last].total < 1.0 / most_share) {
    const double center = nodes_[index(placed[last].heaviest)].tau;
    double next = 2.0 * placed[last].reach / (nodes - 1);
    // The middle of the first nodes is the most likely time, whose spread is known.
    if (last == 0 && 2 * placed[0].heaviest == nodes - 1) {
      next = std::min(next, node_reach * point_.spread);
    }
    placed[++last] = place(event, center, next, nodes, belief);
  }
  if (!std::isfinite(placed[last].largest)) return false;
  // Masses as integrals over the time, over exp(largest) of the last placement.
  const auto mass = [&](const Placement& of, double total) {
    return total * of.reach * std::exp(of.largest - placed[last].largest);
  };
  double inside = mass(placed[last], placed[last].total);
  std::size_t used = last;
  double of_peak = inside;
  for (std::size_t i = last; i-- > 0;) {
    const double outside = mass(placed[i], placed[i].total - 1.0);
    if (outside > (1.0 - most_share) * (inside + outside)) {
      used = i;
      of_peak = inside;
    }
    inside += outside;
  }
  double largest = placed[used].largest;
  if (used < last) {
    const Placement& of = placed[used];
    place(event, of.center, of.reach, nodes, belief);
    nodes_[index(of.heaviest)].log_weight = placed[last].largest + std::log(of_peak / of.reach);
    largest = -infinity;
    for (int i = 0; i < nodes; ++i) largest = std::max(largest, nodes_[index(i)].log_weight);
  }
  collapse(largest, nodes, belief);
  describe(event, nodes, belief);
  return belief.z.allFinite() && belief.S.allFinite();
}

// Sets the belief's time, held contacts and impact estimate from the nodes.
void EventFilter::describe(const Event& event, int nodes, FilterBelief& belief) {
  ImpactEstimate& impact = belief.impact;
  double mean = 0.0, squares = 0.0, rebound = 0.0, heaviest = 0.0, departs = 0.0;
  impact.before = impact.after = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const Node& node = nodes_[index(i)];
    const double tau = node.tau - point_.tau;
    mean += node.log_weight * tau;
    squares += node.log_weight * square(tau);
    impact.before += node.log_weight * node.gamma;
    impact.after += node.log_weight * node.after;
    if (node.log_weight <= heaviest) continue;
    heaviest = node.log_weight;
    departs = node.departs;
    rebound = event.kind == Kind::impact ? flight().restitution(event.contact, node.gamma) *
                                               std::hypot(node.gamma, node.gamma_sigma)
                                         : 0.0;
    if (event.kind == Kind::opens) {
      impact.jump.setZero();
    } else {
      impact.jump = node.jump;
    }
  }
  double of_before = 0.0, of_after = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const Node& node = nodes_[index(i)];
    of_before += node.log_weight * (square(node.gamma - impact.before) + square(node.gamma_sigma));
    of_after += node.log_weight * (square(node.after - impact.after) + square(node.after_sigma));
  }
  impact.before_sigma = std::sqrt(of_before);
  impact.after_sigma = std::sqrt(of_after);
  belief.square += departs;
  belief.t = event.t - point_.tau;
  belief.occurred[event.contact] = belief.t;
  belief.rebound[event.contact] = rebound;
  const double rounding = belief.sigma > 0.0 ? measurement_rounding * event.t : 0.0;
  impact.time_sigma = std::hypot(std::sqrt(std::max(squares - square(mean), 0.0)), rounding);
  impact.time = belief.t - mean;
  impact.held_before = belief.held;
  belief.held = nodes_.front().held;
}

bool EventFilter::take(const ContactEvent& event, FilterBelief& belief, const FilterBelief* about) {
  const std::size_t steps = steps_ != nullptr ? steps_->size() : 0;
  const bool taken = update(event, belief, about);
  if (steps_ != nullptr && steps_->size() > steps) {
    steps_->back().after = belief;
    steps_->back().contact = event.contact;
  }
  return taken;
}

bool EventFilter::take(std::span<const ContactEvent> events, FilterBelief& belief) {
  // With exact times, the reports of the instant determine which held contacts stay closed.
  const bool beside = (belief.held & ~bit(events.front().contact)) != 0;
  if (belief.sigma == 0.0 && (events.size() > 1 || beside)) return take_together(events, belief);
  double largest = 0.0;
  for (const ContactEvent& event : events) {
    if (!take(event, belief)) return false;
    largest = std::max(largest, belief.square);
  }
  belief.square = largest;
  return true;
}

bool EventFilter::update(const ContactEvent& given, FilterBelief& belief,
                         const FilterBelief* about) {
  Event event{given.contact, Kind::impact, given.t, 0.0};
  if (given.kind == ContactEventKind::opens) event.kind = Kind::opens;
  if (given.kind == ContactEventKind::closes) event.kind = Kind::stays;
  const bool opens = event.kind == Kind::opens;
  expire(event.t, belief);
  const double since = event.t - belief.reported[event.contact];
  const bool held = contains(belief.held, event.contact);
  belief.square = 0.0;
  belief.closed = after(belief.closed, given);
  if (opens && !held) return true;  // forced release by an earlier impact, or a repeated report
  belief.reported[event.contact] = event.t;
  const bool is_close = since < indistinct * belief.sigma;
  if (is_close && !opens && (held || !resolves(event, belief))) return burst(event, belief);
  // The contact may have bounced in between. Without a burst and a rebound it was held, and its
  // release is a measurement like any other.
  if (is_close && opens &&
      (contains(belief.bursting, event.contact) || belief.rebound[event.contact] > 0.0)) {
    let_go(event.contact, belief);
    return true;
  }
  if (!opens && !contains(flight().independent(belief.held, belief.held | bit(event.contact)),
                          event.contact)) {
    return true;  // the held contacts already constrain its direction
  }
  const bool exact = belief.sigma == 0.0;
  if (exact && opens && (belief.held & ~bit(event.contact)) != 0) {
    // The master may have held several contacts although a force was negative (holds_together() in
    // master.h). Then the opening does not imply lambda = 0.
    belief.rebound[event.contact] = 0.0;
    let_go(event.contact, belief);
    return true;
  }
  at_.spread(belief, event.t - belief.t);
  if (exact && contains(belief.touched, event.contact)) {
    event.extra = square(touching * belief.length);
  }
  if (exact && event.kind == Kind::stays) {
    at_.fly(event.t, belief.z, belief);
    at_.look(event.contact, false, event.t);
    event.extra += variance_of_unreported(event);
  }
  const bool expected = about != nullptr && expect(event, *about, belief);
  if (!expected && !find(event, belief)) return false;
  int nodes = 1;
  if (!exact) {
    const double turns = flight().largest_frequency() * point_.spread;
    const double wanted = 2.0 * node_reach * (2.0 * turns + 4.0) / (2.0 * std::numbers::pi);
    nodes = static_cast<int>(
        std::clamp(std::round(wanted) + 1.0, 1.0 * fewest_nodes, 1.0 * most_nodes));
  }
  double reach = node_reach * point_.spread;
  if (!expected && point_.grazes) {
    // The event time may have several maxima of its posterior, so the nodes cover all of the
    // jitter. A narrow maximum is one of the nodes.
    const double apart = 2.0 * node_reach * belief.sigma / (most_nodes - 1);
    if (point_.spread > apart) point_.tau = 0.0;
    reach = node_reach * belief.sigma + std::abs(point_.tau);
    nodes = most_nodes;
  }
  belief.square = point_.square;
  belief.bursting &= ~bit(event.contact);
  const double before = exact && model_.homogeneous ? energy(at_.x) : 0.0;
  if (!condense(event, reach, nodes, belief)) return false;
  if (before > 0.0) {
    const double energy_left = energy(x_);
    belief.log_left += std::log(energy_left / before);
    if (-2.0 * belief.log_left > square(certain)) belief.square = infinity;
  }
  if (exact) note_touched(event.t, event.contact, belief);
  return true;
}

// Updates `touched`. If a contact's gap is zero at an impact of another contact, the master may
// find it closed when it returns to zero, within its tolerance of a touch.
void EventFilter::note_touched(double t, int contact, FilterBelief& belief) {
  if (flight().contacts() == 1) return;
  flight().fly(belief.z.head(2 * n()), belief.t, t - belief.t, belief.held);
  for (int i = 0; i < flight().contacts(); ++i) {
    if (i == contact) continue;
    const Flight::Gap gap = flight().gap(i);
    const bool touches = std::abs(gap.g) < touching * std::max(belief.length, gap.length);
    belief.touched = touches ? belief.touched | bit(i) : belief.touched & ~bit(i);
  }
  belief.touched &= ~belief.closed;
}

// Updates the belief by events of one instant with exact times. Several impacts of one contact are
// consecutive; impacts of different contacts are one simultaneous impact.
bool EventFilter::take_together(std::span<const ContactEvent> events, FilterBelief& belief) {
  const double t = events.front().t;
  double largest = 0.0;
  for (std::size_t first = 0; first < events.size();) {
    ContactSet reported = 0, closing = 0, staying = 0, closed = belief.closed;
    std::size_t end = first;
    for (; end < events.size() && !contains(reported, events[end].contact); ++end) {
      const ContactEvent& event = events[end];
      const ContactSet own = bit(event.contact);
      reported |= own;
      closed = after(closed, event);
      if (event.kind == ContactEventKind::opens || contains(belief.held, event.contact)) continue;
      closing |= own;
      if (event.kind == ContactEventKind::closes) staying |= own;
    }
    const std::span<const ContactEvent> stage = events.subspan(first, end - first);
    first = end;
    if (closing == 0) {
      for (const ContactEvent& event : stage) {
        if (!take(event, belief)) return false;
        largest = std::max(largest, belief.square);
      }
      continue;
    }
    const ContactSet kept = belief.held & closed;
    closing = flight().independent(kept, kept | closing) & ~kept;
    at_.spread(belief, t - belief.t);
    at_.fly(t, belief.z, belief);
    x_ = at_.x;
    belief.square = 0.0;
    if (!measure_together(t, closing, staying, belief)) return false;
    largest = std::max(largest, belief.square);
    kick_.setZero();
    flight().fly(x_, t, 0.0, 0);
    if (!flight().strike_together(closing, closing & staying, kept, belief.held & ~closed, x_,
                                  at_.X.leftCols(at_.A.cols()), kick_)) {
      return false;
    }
    belief.closed = closed;
    belief.held = flight().independent(kept | (closing & staying), closed);
    belief.t = t;
    belief.bursting &= belief.held;
    belief.impact.time_sigma = 0.0;
    flight().fly(x_, t, 0.0, belief.held);
    belief.z.head(2 * n()) = flight().x();
    Eigen::Index columns = at_.A.cols();
    at_.X.col(columns++) = kick_;
    at_.X.col(columns).setZero();
    for_each(closing, [&](int i) {
      flight().along(i, kick_);
      at_.X.col(columns) += (contact_rounding * belief.speed) * kick_;
    });
    ++columns;
    flight().carry(at_.X.leftCols(columns));
    all_.topLeftCorner(at_.size(), columns) = at_.X.leftCols(columns);
    keep(columns, belief);
    for_each(reported, [&](int i) { belief.reported[i] = belief.occurred[i] = t; });
    for (int i = 0; i < flight().contacts(); ++i) note_touched(t, i, belief);
  }
  belief.square = largest;
  return belief.z.allFinite() && belief.S.allFinite();
}

// Measures g_i = 0 of the closing contacts at the end of the flight. x_ is the mean.
bool EventFilter::measure_together(double t, ContactSet closing, ContactSet staying,
                                   FilterBelief& belief) {
  const double before = model_.homogeneous ? energy(x_) : 0.0;
  for_each(closing, [&](int i) {
    flight().fly(x_, t, 0.0, 0);
    at_.look(i, false, t);
    belief.length = std::max(belief.length, at_.of.length);
    belief.speed = std::max(belief.speed, std::abs(at_.of.velocity));
    double noise = at_.noise + square(touching * belief.length);
    if (contains(staying, i)) noise += variance_of_unreported({i, Kind::stays, t, 0.0});
    const double variance = at_.phi.squaredNorm() + noise;
    const double floor = square(contact_rounding * belief.length);
    belief.square = std::max(belief.square, square(at_.of.g) / (variance + floor));
    belief.innovation = {t, i, at_.of.g, std::sqrt(variance)};
    at_.measure(at_.of.g, noise, x_, c_);
  });
  if (before > 0.0) {
    belief.log_left += std::log(energy(x_) / before);
    if (-2.0 * belief.log_left > square(certain)) belief.square = infinity;
  }
  return x_.allFinite();
}

// Holds the contact closed over a burst, until a report of a sustained closing or 3 sigma without a
// report.
bool EventFilter::burst(const Event& given, FilterBelief& belief) {
  const int contact = given.contact;
  if (contains(belief.held, contact)) {
    if (given.kind == Kind::stays && contains(belief.bursting, contact)) close(given, belief);
    return true;
  }
  if (!contains(flight().independent(belief.held, belief.held | bit(contact)), contact)) {
    return true;
  }
  at_.spread(belief, given.t - belief.t);
  at_.fly(given.t, belief.z, belief);
  at_.look(contact, false, given.t);
  const double speed = belief.rebound[contact] > 0.0 ? belief.rebound[contact]
                                                     : std::hypot(at_.of.velocity, at_.psi.norm());
  point_.z = belief.z;
  // The burst follows the contact's last event, which may be later than this report.
  point_.tau = std::min(0.0, given.t - belief.occurred[contact]);
  const Event event{contact, Kind::stays, given.t,
                    square(speed * belief.sigma) + std::numeric_limits<double>::min()};
  if (!condense(event, node_reach * belief.sigma, spread_nodes, belief)) return false;
  belief.rebound[contact] = speed;
  if (given.kind != Kind::stays) belief.bursting |= bit(contact);
  return true;
}

// Ends a burst by a report of a sustained closing: measures g = 0, and the contact stays held.
void EventFilter::close(const Event& given, FilterBelief& belief) {
  belief.bursting &= ~bit(given.contact);
  at_.spread(belief, given.t - belief.t);
  at_.fly(given.t, belief.z, belief);
  at_.look(given.contact, false, given.t);
  x_ = at_.x;
  c_ = belief.z.tail(unknowns());
  at_.measure(at_.of.g, at_.noise + std::numeric_limits<double>::min(), x_, c_);
  belief.z << x_, c_;
  belief.t = given.t;
  past_mean_ = at_.past_mean;
  keep(take_columns(), belief);
}

// Copies the columns of the flight to all_.
Eigen::Index EventFilter::take_columns() {
  const Eigen::Index columns = at_.event_columns();
  for (Eigen::Index j = 0; j < columns; ++j) {
    all_.col(j).head(2 * n()) = at_.X.col(j);
    all_.col(j).segment(2 * n(), unknowns()) = at_.T.col(j);
    if (steps_ != nullptr) all_.col(j).tail(at_.size()) = at_.past.col(j);
  }
  return columns;
}

void EventFilter::expire(double t, FilterBelief& belief) {
  for_each(belief.bursting, [&](int contact) {
    if (t >= belief.reported[contact] + indistinct * belief.sigma) let_go(contact, belief);
  });
}

double EventFilter::end_of_burst(const FilterBelief& belief) {
  double end = infinity;
  for_each(belief.bursting, [&](int contact) {
    end = std::min(end, belief.reported[contact] + indistinct * belief.sigma);
  });
  return end;
}

bool EventFilter::can_separate(std::span<const ContactEvent> events, const FilterBelief& belief) {
  const double reach = indistinct * belief.sigma;
  const auto is_recent = [&](int i, double t) { return t < belief.reported[i] + reach; };
  for (const ContactEvent& event : events) {
    for (int i = 0; i < flight().contacts(); ++i) {
      if (i == event.contact || !is_recent(i, event.t)) continue;
      if (!contains(belief.bursting, i) && !is_recent(event.contact, event.t)) continue;
      fly_mean(belief.t, belief);
      flight().gradients(i, false, at_.of_g, at_.of_velocity);
      flight().along(event.contact, kick_);
      if (std::abs(at_.of_velocity.dot(kick_)) > contact_rounding) return false;
    }
  }
  return true;
}

// Releases a held contact at its last report, with the speed that follows a burst (leaving_speed)
// and its deviation.
void EventFilter::let_go(int contact, FilterBelief& belief) {
  const double t = std::max(belief.reported[contact], belief.t);
  at_.spread(belief, t - belief.t);
  at_.fly(t, belief.z, belief);
  flight().along(contact, kick_);
  const double speed = belief.rebound[contact];
  belief.z.head(2 * n()) = at_.x + (leaving_speed * speed) * kick_;
  belief.t = t;
  belief.held = released(contact, belief);
  belief.bursting &= ~bit(contact);
  belief.impact.time_sigma = 0.0;
  Eigen::Index columns = take_columns();
  past_mean_ = at_.past_mean;
  all_.col(columns).setZero();
  all_.col(columns++).head(2 * n()) = (leaving_sigma * speed) * kick_;
  keep(columns, belief);
}

void EventFilter::restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
                          const Eigen::Ref<const Eigen::MatrixXd>& S_x, ContactSet closed,
                          FilterBelief& belief) {
  at_.spread(belief, t - belief.t);
  const Eigen::Index P = unknowns(), size = at_.size();
  // Marginal square root of the parameters: their rows alone, triangular in the first P columns.
  all_.topLeftCorner(size, at_.A.cols()) = at_.A;
  triangularize(all_, 2 * n(), size, at_.A.cols(), reflector_);
  belief.S.setZero();
  belief.S.bottomRightCorner(P, P) = all_.block(2 * n(), 0, P, P);
  belief.S.topLeftCorner(2 * n(), 2 * n()) = S_x;
  belief.t = t;
  belief.closed = closed;
  belief.held = flight().independent(0, closed);
  belief.bursting = belief.touched = 0;
  belief.impact.time_sigma = 0.0;
  belief.log_left = 0.0;
  belief.rebound.setZero();
  belief.z.head(2 * n()) = x;
}

const Eigen::VectorXd& EventFilter::mean(double t, const FilterBelief& belief) {
  at_.spread(belief, t - belief.t);
  at_.fly(t, belief.z, belief);
  return at_.x;
}

const Eigen::VectorXd& EventFilter::publish_mean(double t, const FilterBelief& belief) {
  if (belief.sigma > 0.0) return publish(t, belief);
  fly_mean(t, belief);
  at_.x = flight().x();
  return at_.x;
}

void EventFilter::fly_mean(double t, const FilterBelief& belief) {
  flight().set(belief.z.tail(unknowns()), false);
  flight().fly(belief.z.head(2 * n()), belief.t, t - belief.t, belief.held);
}

const Eigen::VectorXd& EventFilter::publish(double t, const FilterBelief& belief) {
  published_.find(t, belief);
  return at_.x;
}

void EventFilter::gap_deviations(const FilterBelief& belief, Eigen::Ref<Eigen::MatrixXd> of_gaps) {
  for (int i = 0; i < flight().contacts(); ++i) {
    flight().gradients(i, false, at_.of_g, at_.of_velocity);
    of_gaps.row(i).noalias() = at_.of_g.transpose().lazyProduct(at_.X);
    if (unknowns() == 0 || belief.held != 0) continue;
    flight().differences(i, false, at_.by_c, at_.velocity_by_c);
    at_.by_c.noalias() -= flight().by_unknowns().transpose().lazyProduct(at_.of_g);
    of_gaps.row(i).noalias() += at_.by_c.transpose().lazyProduct(at_.T);
  }
}

const Eigen::VectorXd& EventFilter::force_row(int contact, double t, Flight::Gap& force) {
  at_.look(contact, true, t);
  force = at_.of;
  return at_.phi;
}

EventFilter::Crossing EventFilter::crossing(int contact, double t, const FilterBelief& belief) {
  mean(t, belief);
  at_.look(contact, false, t);
  return {at_.of.g, at_.of.velocity, at_.phi.norm()};
}

// An event is overdue if a gap, or the force of a held contact, is negative beyond its deviation
// and has been negative for longer than a report can be late.
int EventFilter::overdue(double t, const FilterBelief& belief) {
  fly_mean(t, belief);
  for (int i = 0; i < flight().contacts(); ++i) {
    const bool held = contains(belief.held, i);
    // Of several held contacts a force may be negative (holds_together() in master.h).
    if (held && belief.held != bit(i)) continue;
    const auto signal = [&] { return held ? flight().force(i).g : flight().gap(i).g; };
    if (!(signal() < 0.0)) continue;
    // The master does not report the bounces of a completed chatter, which last up to chatter_time.
    const double before = t - certain * belief.sigma - (held ? 0.0 : model_.chatter_time);
    if (!(before > belief.t)) continue;
    mean(t, belief);
    at_.look(i, held, t);
    const double rounding = contact_rounding * at_.of.rounding;
    const double deviation = std::sqrt(at_.phi.squaredNorm() + at_.noise + square(rounding));
    if (!(at_.of.g < -certain * deviation)) continue;
    fly_mean(before, belief);
    if (signal() < 0.0) return i;
    fly_mean(t, belief);
  }
  return -1;
}

double EventFilter::open_until(double t, const FilterBelief& belief) {
  if (belief.held != 0) return t;
  for (int i = 0; i < flight().contacts(); ++i) {
    if (!(flight().gap(i).g > 0.0)) return t;
  }
  return t + flight().open_for();
}

}  // namespace sprag
