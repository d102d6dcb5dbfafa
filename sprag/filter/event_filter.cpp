#include "sprag/filter/event_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "sprag/estimation/belief.h"
#include "sprag/estimation/event_mixture.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// Gauss-Newton on the time of an event.
constexpr int most_steps = 12;
constexpr double settled = 1e-2;      // of the time's deviation
constexpr double longest_step = 2.0;  // of sigma
constexpr int newton_steps = 4;
constexpr double scan_reach = 4.0;  // of sigma
constexpr int scanned = 17;         // times
// Nodes about it.
constexpr double node_reach = 4.2;  // deviations
constexpr int fewest_nodes = 5, most_nodes = 25;
constexpr double negligible = 1e-14;  // weight of a node
// Reports of a contact that are closer, in sigma, are a burst.
constexpr double close_reports = 3.0;
constexpr double burst_reach = 2.5;
constexpr int burst_nodes = 11;
// A contact leaves a burst with this share of its speed before, and the deviation of that.
constexpr double leaving_speed = 0.75, leaving_sigma = 0.6;
// The tick may precede the last impact by so many deviations of its time.
constexpr double publish_reach = 6.0;
constexpr double near_gap = 8.0;  // deviations of a gap that may have closed unreported
// Least probability that a tick lies on the other side of an impact: no deviation of a predicted
// time is known to be Gaussian further out.
constexpr double least_probability = 1e-4;
// Silence: deviations of the gap, and of the time of the report.
constexpr double silent_gaps = 6.7, silent_reports = 9.0;
// Of what no prior is known: deviations in units of the largest value on the path, and of c.
constexpr double wide_state = 3.0, wide_share = 2.0;

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

}  // namespace

EventFilter::EventFilter(const MachineFamily& family, FilterModel model)
    : family_(&family), model_(std::move(model)), flight_(family), onward_(family) {
  std::vector<bool>& considered = model_.considered;
  considered.resize(static_cast<std::size_t>(unknowns()), false);
  considers_ = std::find(considered.begin(), considered.end(), true) != considered.end();
  if (!(model_.walk.size() > 0 && model_.walk.maxCoeff() > 0.0)) model_.walk.resize(0);
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    if (flight_.changes_flow(k)) flow_unknowns_.push_back(k);
  }
  const Eigen::Index before = size() + model_.walk.size() + model_.drift.cols();
  // Second-order columns; one of the Schmidt update; three of publishing.
  const Eigen::Index columns = before * (1 + std::ssize(flow_unknowns_)) + 1;
  A_.setZero(size(), before);
  at_.x.setZero(2 * n());
  at_.X.setZero(2 * n(), columns + 2);
  at_.T.setZero(unknowns(), columns + 2);
  at_.phi.setZero(columns + 2);
  at_.psi.setZero(columns + 2);
  at_.by_c.setZero(unknowns());
  at_.rate_by_c.setZero(unknowns());
  xi_.setZero(before);
  next_.setZero(columns + 2);
  gain_.setZero(size());
  dx_.setZero(2 * n());
  direction_.setZero(2 * n());
  offset_.setZero(size());
  c_.setZero(unknowns());
  c_by_c_.setZero(unknowns());
  rate_by_c_.setZero(unknowns());
  x_.setZero(2 * n());
  unit_.setZero(columns + 2);
  nodes_.resize(most_nodes);
  for (Node& node : nodes_) {
    node.z.setZero(size());
    node.columns.setZero(size(), columns);
  }
  all_.setZero(size(), most_nodes * (columns + 1));
  past_mean_.setZero(size());
  past_gain_.setZero(size());
  reflector_.setZero(all_.cols());
  point_.z.setZero(size());
}

FilterBelief EventFilter::no_belief() const {
  FilterBelief belief;
  belief.z.setZero(size());
  belief.S.setZero(size(), size());
  const auto m = family_->contacts();
  belief.reported.setConstant(m, -infinity);
  belief.occurred.setConstant(m, -infinity);
  belief.speed.setZero(m);
  belief.jump.setZero(2 * n());
  return belief;
}

void EventFilter::record_in(std::vector<FilterStep>* steps) {
  steps_ = steps;
  if (steps == nullptr) return;
  const Eigen::Index columns = nodes_.front().columns.cols();
  at_.past.setZero(size(), at_.X.cols());
  for (Node& node : nodes_) {
    node.past_mean.setZero(size());
    node.past.setZero(size(), columns);
  }
  all_.setZero(2 * size(), std::max(all_.cols(), 2 * size()));
  reflector_.setZero(all_.cols());
}

// What machine and parameters do in the meantime is taken as done at the beginning.
void EventFilter::spread(const FilterBelief& belief, double duration) {
  A_.setZero();
  A_.leftCols(size()) = belief.S;
  const double root = std::sqrt(std::max(duration, 0.0));
  const Eigen::Index walking = model_.walk.size();
  for (Eigen::Index k = 0; k < walking; ++k) A_(2 * n() + k, size() + k) = model_.walk[k] * root;
  A_.topRightCorner(2 * n(), model_.drift.cols()) = root * model_.drift;
}

// A deviation of (y, y', c) before the flight becomes dx_, that of (y, y') after it.
void EventFilter::carry(const Eigen::Ref<const Eigen::VectorXd>& dz) {
  dx_ = dz.head(2 * n());
  flight_.carry(dx_);
  dx_.noalias() += flight_.by_unknowns().lazyProduct(dz.tail(unknowns()));
}

// Flight to t of the point z and of the columns A_.
void EventFilter::linearize(double t, const Eigen::VectorXd& z, const FilterBelief& belief,
                            bool second_order) {
  const bool with_c = unknowns() > 0;
  flight_.set(z.tail(unknowns()), with_c);
  flight_.fly(z.head(2 * n()), belief.t, t - belief.t, belief.held);
  at_.x = flight_.x();
  const Eigen::Index known = A_.cols();
  at_.X.setZero();
  at_.T.setZero();
  for (Eigen::Index j = 0; j < known; ++j) {
    carry(A_.col(j));
    at_.X.col(j) = dx_;
  }
  at_.T.leftCols(known) = A_.bottomRows(unknowns());
  if (steps_ != nullptr) {
    at_.past.setZero();
    at_.past.leftCols(size()).setIdentity();
    past_mean_.setZero();
  }
  if (belief.held >= 0 || !second_order) return;
  Eigen::Index first = known;
  for (const Eigen::Index k : flow_unknowns_) {
    const double sigma = A_.row(2 * n() + k).norm();
    for (Eigen::Index j = 0; j < known; ++j) {
      dx_ = A_.col(j).head(2 * n());
      flight_.carry_by_unknown(k, dx_);
      at_.X.col(first + j) = sigma * dx_;
    }
    first += known;
  }
}

// What is zero at the event, after linearize().
void EventFilter::look(int contact, bool of_force, double t) {
  at_.of = of_force ? flight_.force(contact) : flight_.gap(contact);
  flight_.direction(contact, of_force, direction_);
  at_.phi.noalias() = at_.X.transpose().lazyProduct(direction_);
  if (of_force) {
    at_.psi.setZero();
  } else {
    at_.psi.noalias() = at_.X.bottomRows(n()).transpose().lazyProduct(direction_.head(n()));
  }
  if (unknowns() > 0) {
    // Total derivatives since the last event, less those by way of the state.
    flight_.differences(contact, of_force, at_.by_c, at_.rate_by_c);
    at_.by_c.noalias() -= flight_.by_unknowns().transpose().lazyProduct(direction_);
    if (!of_force) {
      at_.rate_by_c.noalias() -=
          flight_.by_unknowns().bottomRows(n()).transpose().lazyProduct(direction_.head(n()));
    }
    at_.phi.noalias() += at_.T.transpose().lazyProduct(at_.by_c);
    if (!of_force) at_.psi.noalias() += at_.T.transpose().lazyProduct(at_.rate_by_c);
  }
  at_.noise = square(measurement_rounding * at_.of.rounding) +
              square(2.0 * machine_epsilon * t * at_.of.velocity);
}

// A start for the steps: the best of several times, each with one Newton step.
void EventFilter::scan(int contact, double t, const FilterBelief& belief) {
  const double sigma = belief.sigma;
  const double half = scan_reach * sigma / (scanned - 1);
  double least = infinity;
  for (int i = 0; i < scanned; ++i) {
    double tau = scan_reach * sigma * (2.0 * i / (scanned - 1) - 1.0);
    linearize(t - tau, belief.z, belief);
    look(contact, false, t);
    double g = at_.of.g, v = at_.of.velocity;
    const double s2 = at_.phi.squaredNorm() + at_.noise;
    const double move = std::clamp(
        (g * v / s2 - tau / square(sigma)) / (1.0 / square(sigma) + square(v) / s2), -half, half);
    g -= v * move;
    tau += move;
    if (t - tau < belief.occurred[contact]) continue;
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

// The most likely time, by Gauss-Newton on (xi, tau / sigma).
bool EventFilter::find(int contact, Kind kind, double t, FilterBelief& belief, Point& point) {
  const bool opens = kind == Kind::opens;
  const double sigma = belief.sigma;
  xi_.setZero();
  xi_tau_ = 0.0;
  point.z = belief.z;
  for (int step = 0; step < most_steps; ++step) {
    linearize(t - sigma * xi_tau_, point.z, belief);
    look(contact, opens, t);
    if (step == 0 && !opens) {
      const double v = at_.of.velocity;
      const double variance = at_.phi.squaredNorm() + square(v * sigma) + at_.noise;
      belief.innovation = {t, contact, at_.of.g, std::sqrt(variance)};
      belief.length = std::max(belief.length, at_.of.length);
      const double margin = at_.psi.norm() + std::abs(at_.of.acceleration) * sigma;
      if (sigma > 0.0 && !(v < -scan_reach * margin)) {
        scan(contact, t, belief);
        point.z = belief.z;
        point.z.noalias() += A_.lazyProduct(xi_);
        linearize(t - sigma * xi_tau_, point.z, belief);
        look(contact, opens, t);
      }
    }
    double noise = at_.noise;
    if (!opens) {
      // The product of the deviations of the time and of the velocity.
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
    point.spread = std::hypot(sigma - of_time * share, at_.phi.norm() * share);
    point.square = square(factor) * (variance - noise);
    point.tau = sigma * xi_tau_;
    if (step > 0 && std::abs(move) <= settled * point.spread + 2.0 * machine_epsilon * t) break;
    const double part = std::abs(move) < longest_step * sigma || sigma == 0.0
                            ? 1.0
                            : longest_step * sigma / std::abs(move);
    xi_ += part * (factor * at_.phi.head(known) - xi_);
    xi_tau_ += part * (factor * of_time - xi_tau_);
    point.z = belief.z;
    point.z.noalias() += A_.lazyProduct(xi_);
    point.tau = sigma * xi_tau_;
    if (!point.z.allFinite()) return false;
  }
  return true;
}

// The time of an event by the belief, linearized about a given state, whose own event is near;
// false where that state has no such event.
bool EventFilter::expect(int contact, Kind kind, double t, const FilterBelief& about,
                         const FilterBelief& belief, Point& point) {
  const bool opens = kind == Kind::opens;
  point.z = about.z;
  flight_.set(about.z.tail(unknowns()), false);
  flight_.fly(about.z.head(2 * n()), about.t, belief.t - about.t, about.held);
  point.z.head(2 * n()) = flight_.x();
  // Its own event.
  double tau = 0.0;
  for (int i = 0; i < newton_steps; ++i) {
    linearize(t - tau, point.z, belief);
    look(contact, opens, t);
    const double step = std::clamp(at_.of.g / at_.of.velocity, -longest_step * belief.sigma,
                                   longest_step * belief.sigma);
    if (!std::isfinite(step)) return false;
    tau += step;
  }
  linearize(t - tau, point.z, belief);
  look(contact, opens, t);
  // A gap that hardly closes there is not linear in the time.
  const double bent = scan_reach * std::abs(at_.of.acceleration) * belief.sigma;
  if (!opens && !(at_.of.velocity < -bent)) return false;
  offset_ = belief.z - point.z;
  carry(offset_);
  const double residual = at_.of.g + at_.of.velocity * tau + direction_.dot(dx_) +
                          at_.by_c.dot(offset_.tail(unknowns()));
  const double of_time = -at_.of.velocity * belief.sigma;
  const double variance = at_.phi.squaredNorm() + square(of_time) + at_.noise;
  if (!(variance > 0.0) || !std::isfinite(residual)) return false;
  point.tau = -belief.sigma * of_time * residual / variance;
  point.spread = belief.sigma * std::sqrt(std::max(1.0 - square(of_time) / variance, 0.0));
  point.square = square(residual) / variance;
  return true;
}

// Moves the mean (x, c) by `shift` times the gain, the columns' product with `direction`, and takes
// `share` of it off the columns along that. Considered parameters stay.
void EventFilter::update_along(const Eigen::VectorXd& direction, double shift, double share,
                               Eigen::VectorXd& x, Eigen::VectorXd& c) {
  gain_.head(2 * n()).noalias() = at_.X.lazyProduct(direction);
  gain_.tail(unknowns()).noalias() = at_.T.lazyProduct(direction);
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    if (model_.considered[static_cast<std::size_t>(k)]) gain_[2 * n() + k] = 0.0;
  }
  x += shift * gain_.head(2 * n());
  c += shift * gain_.tail(unknowns());
  for (Eigen::Index j = 0; j < direction.size(); ++j) {
    at_.X.col(j) -= (share * direction[j]) * gain_.head(2 * n());
    at_.T.col(j) -= (share * direction[j]) * gain_.tail(unknowns());
  }
  if (steps_ == nullptr) return;
  past_gain_.noalias() = at_.past.lazyProduct(direction);
  past_mean_ += shift * past_gain_;
  for (Eigen::Index j = 0; j < direction.size(); ++j) {
    at_.past.col(j) -= (share * direction[j]) * past_gain_;
  }
}

// Potter's update of the columns at_ and of the mean (x, c) by phi: x and c without the considered
// parameters, whose columns stay.
void EventFilter::measure(double residual, double noise, Eigen::VectorXd& x, Eigen::VectorXd& c) {
  const double variance = at_.phi.squaredNorm() + noise;
  const double shrink = 1.0 / (variance * (1.0 + std::sqrt(noise / variance)));
  update_along(at_.phi, -residual / variance, considers_ ? 1.0 / variance : shrink, x, c);
  if (!considers_) return;
  const Eigen::Index last = at_.X.cols() - 3;
  at_.X.col(last) += (std::sqrt(noise) / variance) * gain_.head(2 * n());
  at_.T.col(last) += (std::sqrt(noise) / variance) * gain_.tail(unknowns());
}

// An impact is where the flux through the gap is: gamma < 0, weighted by -gamma.
void EventFilter::weigh_flux(double sigma, double variance, double& gamma, Node& node,
                             Eigen::VectorXd& x, Eigen::VectorXd& c) {
  const double deviation = at_.psi.norm();
  if (!(deviation > 1e-6 * std::abs(gamma))) {
    node.log_weight += std::log(std::max(-gamma, 1e-300));
    return;
  }
  const double even = variance / (std::max(std::abs(gamma), 0.1 * deviation) * square(sigma));
  const FluxMoments moments = flux_moments(gamma, deviation, even);
  const double along = (moments.mean - gamma) / deviation;
  const double rest = std::sqrt(std::max(moments.variance, 1e-6 * square(deviation)));
  const double cut = 1.0 - rest / deviation;
  unit_ = at_.psi / deviation;
  update_along(unit_, along, cut, x, c);
  at_.psi *= 1.0 - cut;
  node.log_weight += moments.log_weight;
  gamma = moments.mean;
}

// The gap velocity after an impact, at the instant of it.
void EventFilter::see_velocity(int contact, Node& node) {
  const auto w = direction_.head(n());
  node.after = onward_.gap(contact).velocity;
  onward_.differences(contact, false, c_by_c_, rate_by_c_);
  double variance = 0.0;
  for (Eigen::Index j = 0; j < at_.X.cols(); ++j) {
    dx_ = at_.X.col(j);
    onward_.carry_through(dx_);
    const double seen = w.dot(dx_.tail(n())) + rate_by_c_.dot(at_.T.col(j));
    variance += square(seen);
  }
  node.after_sigma = std::sqrt(variance);
}

// The belief at t - point.tau if the event was at t - tau.
void EventFilter::condition(int contact, Kind kind, double t, double tau, const Point& point,
                            double extra, const FilterBelief& belief, Node& node) {
  const double when = t - tau;
  linearize(when, point.z, belief);
  look(contact, kind == Kind::opens, t);
  // From the point of linearization to the mean.
  offset_ = belief.z - point.z;
  carry(offset_);
  x_ = at_.x + dx_;
  c_ = belief.z.tail(unknowns());
  const double residual = at_.of.g + direction_.dot(dx_) + at_.by_c.dot(offset_.tail(unknowns()));
  const double noise = at_.noise + extra;
  const double variance = at_.phi.squaredNorm() + noise;
  node.log_weight = -0.5 * (square(residual) / variance + std::log(variance));
  if (belief.sigma > 0.0) node.log_weight -= 0.5 * square(tau / belief.sigma);
  measure(residual, noise, x_, c_);
  const auto theta = point.z.tail(unknowns());
  double gamma = 0.0;
  if (kind != Kind::opens) {
    const auto w = direction_.head(n());
    at_.psi.noalias() = at_.X.bottomRows(n()).transpose().lazyProduct(w);
    at_.psi.noalias() += at_.T.transpose().lazyProduct(at_.rate_by_c);
    gamma = at_.of.velocity + w.dot(x_.tail(n()) - at_.x.tail(n())) + at_.rate_by_c.dot(c_ - theta);
    if (belief.sigma > 0.0 && !considers_ && extra == 0.0) {
      weigh_flux(belief.sigma, variance, gamma, node, x_, c_);
    }
  }
  node.gamma = gamma;
  node.gamma_sigma = at_.psi.norm();
  // Impact and flight to the common time.
  onward_.set(theta, unknowns() > 0);
  onward_.fly(x_, when, 0.0);
  if (kind != Kind::opens) {
    onward_.strike(contact, kind == Kind::stays);
    see_velocity(contact, node);
    node.after += rate_by_c_.dot(c_ - theta);
  }
  const int held = kind == Kind::stays ? contact : -1;
  onward_.fly_on(tau - point.tau, held);
  node.z.head(2 * n()) = onward_.x();
  offset_.tail(unknowns()) = c_ - theta;
  node.z.head(2 * n()).noalias() += onward_.by_unknowns().lazyProduct(offset_.tail(unknowns()));
  node.z.tail(unknowns()) = c_;
  for (Eigen::Index j = 0; j < node.columns.cols(); ++j) {
    dx_ = at_.X.col(j);
    if (kind != Kind::opens) onward_.carry_through(dx_);
    onward_.carry(dx_);
    dx_.noalias() += onward_.by_unknowns().lazyProduct(at_.T.col(j));
    node.columns.col(j).head(2 * n()) = dx_;
    node.columns.col(j).tail(unknowns()) = at_.T.col(j);
  }
  if (steps_ == nullptr) return;
  node.past_mean = past_mean_;
  node.past = at_.past.leftCols(node.columns.cols());
}

// Moments of the nodes.
void EventFilter::collapse(double largest, int nodes, FilterBelief& belief) {
  double total = 0.0;
  for (int i = 0; i < nodes; ++i) {
    double& weight = nodes_[index(i)].log_weight;
    weight = std::exp(weight - largest);
    total += weight;
  }
  const bool records = steps_ != nullptr;
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
      all_.col(columns).head(size()) = root * node.columns.col(j);
      if (records) all_.col(columns).tail(size()) = root * node.past.col(j);
      if (all_.col(columns).squaredNorm() > 0.0) ++columns;
    }
    if (nodes == 1) continue;
    all_.col(columns).head(size()) = root * (node.z - belief.z);
    if (records) all_.col(columns).tail(size()) = root * (node.past_mean - past_mean_);
    ++columns;
  }
  keep(columns, belief);
}

// The columns all_ become those of the belief, and of the step to it.
void EventFilter::keep(Eigen::Index columns, FilterBelief& belief) {
  const Eigen::Index end = steps_ != nullptr ? 2 * size() : size();
  while (columns < end) all_.col(columns++).setZero();
  triangularize(all_, 0, end, columns);
  belief.S = all_.topLeftCorner(size(), size());
  if (steps_ == nullptr) return;
  steps_->push_back({belief, -1, past_mean_, all_.block(size(), 0, size(), size()),
                     all_.block(size(), size(), size(), size())});
}

bool EventFilter::condense(int contact, Kind kind, double t, const Point& point, double reach,
                           double extra, int nodes, FilterBelief& belief) {
  double largest = -infinity;
  for (int i = 0; i < nodes; ++i) {
    const double u = nodes > 1 ? 2.0 * i / (nodes - 1) - 1.0 : 0.0;
    Node& node = nodes_[index(i)];
    condition(contact, kind, t, point.tau + reach * u, point, extra, belief, node);
    if (!(node.log_weight < infinity)) return false;
    largest = std::max(largest, node.log_weight);
  }
  if (!std::isfinite(largest)) return false;
  collapse(largest, nodes, belief);
  double mean = 0.0, squares = 0.0, speed = 0.0, heaviest = 0.0;
  double before = 0.0, after = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const Node& node = nodes_[index(i)];
    const double tau = nodes > 1 ? reach * (2.0 * i / (nodes - 1) - 1.0) : 0.0;
    mean += node.log_weight * tau;
    squares += node.log_weight * square(tau);
    before += node.log_weight * node.gamma;
    after += node.log_weight * node.after;
    if (node.log_weight <= heaviest) continue;
    heaviest = node.log_weight;
    speed = std::hypot(node.gamma, node.gamma_sigma);
    belief.jump.setZero();
    if (kind == Kind::opens) continue;
    dx_.setZero();
    onward_.along(contact, dx_.head(n()));
    const double left = kind == Kind::stays ? 1.0 : 2.0 - onward_.lost_share(contact);
    belief.jump.tail(n()) = (-left * node.gamma) * dx_.head(n());
  }
  double of_before = 0.0, of_after = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const Node& node = nodes_[index(i)];
    of_before += node.log_weight * (square(node.gamma - before) + square(node.gamma_sigma));
    of_after += node.log_weight * (square(node.after - after) + square(node.after_sigma));
  }
  belief.speed_before = before;
  belief.speed_before_sigma = std::sqrt(of_before);
  belief.speed_after = after;
  belief.speed_after_sigma = std::sqrt(of_after);
  belief.t = t - point.tau;
  belief.occurred[contact] = belief.t;
  belief.speed[contact] = kind == Kind::opens ? 0.0 : (1.0 - onward_.lost_share(contact)) * speed;
  belief.impact_sigma =
      kind == Kind::opens ? 0.0 : std::sqrt(std::max(squares - square(mean), 0.0));
  belief.impact_time = belief.t - mean;
  if (belief.held >= 0 || kind == Kind::stays) belief.impact_sigma = 0.0;
  belief.held = kind == Kind::stays ? contact : -1;
  return belief.z.allFinite() && belief.S.allFinite();
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

bool EventFilter::update(const ContactEvent& event, FilterBelief& belief,
                         const FilterBelief* about) {
  const double t = event.t;
  const int contact = event.contact;
  expire(t, belief);
  const bool opens = event.kind == ContactEventKind::opens;
  const bool stays = event.kind == ContactEventKind::closes;
  const double since = t - belief.reported[contact];
  belief.square = 0.0;
  if (opens && belief.held != contact) return true;
  belief.reported[contact] = t;
  if (since < close_reports * belief.sigma) {
    if (opens) {
      let_go(belief);
      return true;
    }
    return burst(contact, stays, t, belief);
  }
  spread(belief, t - belief.t);
  const Kind kind = opens ? Kind::opens : stays ? Kind::stays : Kind::impact;
  const bool expected = about != nullptr && expect(contact, kind, t, *about, belief, point_);
  if (!expected && !find(contact, kind, t, belief, point_)) return false;
  const double omega = flight_.largest_frequency();
  int nodes = 1;
  if (belief.sigma > 0.0) {
    const double wanted =
        2.0 * node_reach * (2.0 * omega * point_.spread + 4.0) / (2.0 * std::numbers::pi);
    nodes = static_cast<int>(
        std::clamp(std::round(wanted) + 1.0, 1.0 * fewest_nodes, 1.0 * most_nodes));
  }
  belief.square = point_.square;
  belief.burst = false;
  return condense(contact, kind, t, point_, node_reach * point_.spread, 0.0, nodes, belief);
}

// The contact is taken to rest until it is reported closed, or nothing has come for a while.
bool EventFilter::burst(int contact, bool stays, double t, FilterBelief& belief) {
  if (belief.held == contact) {
    if (stays) belief.burst = false;
    return true;
  }
  spread(belief, t - belief.t);
  linearize(t, belief.z, belief);
  look(contact, false, t);
  const double speed = belief.speed[contact] > 0.0 ? belief.speed[contact]
                                                   : std::hypot(at_.of.velocity, at_.psi.norm());
  point_.z = belief.z;
  point_.tau = 0.0;
  const double extra = square(speed * belief.sigma) + std::numeric_limits<double>::min();
  if (!condense(contact, Kind::stays, t, point_, burst_reach * belief.sigma, extra, burst_nodes,
                belief)) {
    return false;
  }
  belief.speed[contact] = speed;
  belief.burst = !stays;
  return true;
}

void EventFilter::expire(double t, FilterBelief& belief) {
  if (!belief.burst || belief.held < 0) return;
  if (t > belief.reported[belief.held] + close_reports * belief.sigma) let_go(belief);
}

// A burst has ended: the contact left at its last report.
void EventFilter::let_go(FilterBelief& belief) {
  const int contact = belief.held;
  const double t = std::max(belief.reported[contact], belief.t);
  spread(belief, t - belief.t);
  linearize(t, belief.z, belief);
  dx_.setZero();
  flight_.along(contact, dx_.tail(n()));
  const double speed = belief.speed[contact];
  belief.z.head(2 * n()) = at_.x + (leaving_speed * speed) * dx_;
  belief.t = t;
  belief.held = -1;
  belief.burst = false;
  belief.impact_sigma = 0.0;
  Eigen::Index columns = 0;
  for (Eigen::Index j = 0; j < A_.cols(); ++j, ++columns) {
    all_.col(columns).head(2 * n()) = at_.X.col(j);
    all_.col(columns).segment(2 * n(), unknowns()) = at_.T.col(j);
    if (steps_ != nullptr) all_.col(columns).tail(size()) = at_.past.col(j);
  }
  all_.col(columns).setZero();
  all_.col(columns++).head(2 * n()) = (leaving_sigma * speed) * dx_;
  keep(columns, belief);
}

// Rows first to end - 1 of A become lower triangular, the first of them in column 0, without a
// change of A A^T of the rows from `first` on.
void EventFilter::triangularize(FilterBelief::Rows& A, Eigen::Index first, Eigen::Index end,
                                Eigen::Index columns) {
  for (Eigen::Index i = 0; i < end - first; ++i) {
    const Eigen::Index length = columns - i;
    auto row = A.row(first + i).segment(i, length);
    const double norm = row.norm();
    if (!(norm > 0.0)) continue;
    auto v = reflector_.head(length);
    v = row.transpose();
    const double head = v[0] > 0.0 ? -norm : norm;
    v[0] -= head;
    const double scale = 2.0 / v.squaredNorm();
    row.setZero();
    row[0] = head;
    for (Eigen::Index k = first + i + 1; k < end; ++k) {
      auto below = A.row(k).segment(i, length);
      const double share = scale * below.dot(v);
      below -= share * v.transpose();
    }
  }
}

double EventFilter::cost(double t, const FilterBelief& belief) const {
  return belief.held < 0 ? 1.0 : flight_.cost_of_holding(t - belief.t);
}

void EventFilter::restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
                          const Eigen::Ref<const Eigen::MatrixXd>& S_x, FilterBelief& belief) {
  spread(belief, t - belief.t);
  const Eigen::Index P = unknowns();
  // The parameters' rows alone, triangular in the first P columns.
  all_.topLeftCorner(size(), A_.cols()) = A_;
  triangularize(all_, 2 * n(), size(), A_.cols());
  belief.S.setZero();
  belief.S.bottomRightCorner(P, P) = all_.block(2 * n(), 0, P, P);
  belief.S.topLeftCorner(2 * n(), 2 * n()) = S_x;
  belief.t = t;
  belief.held = -1;
  belief.burst = false;
  belief.impact_sigma = 0.0;
  belief.speed.setZero();
  belief.z.head(2 * n()) = x;
}

// (y, y') at the start of a stretch, of which the path holds the free part.
Eigen::VectorXd EventFilter::start_of(const Likelihood& path, std::size_t s) const {
  const Machine machine = family_->at(path.values);
  const Eigen::VectorXd inputs = family_->inputs(path.values);
  Eigen::VectorXd x = path.x0[s];
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const std::complex<double> z = std::complex<double>(inputs[2 * g], inputs[2 * g + 1]) *
                                   std::polar(1.0, machine.frequencies[g] * path.path[s].start);
    const std::complex<double> rate(0.0, machine.frequencies[g]);
    x.head(n()) += (machine.response.col(g) * z).real();
    x.tail(n()) += (machine.response.col(g) * (z * rate)).real();
  }
  return x;
}

// Of |y| and |y'| on the path.
std::vector<double> EventFilter::largest(const Likelihood& path, const Eigen::VectorXd& c) {
  std::vector<double> sizes(static_cast<std::size_t>(2 * n()), 0.0);
  flight_.set(c, true);
  for (std::size_t s = 0; s < path.path.size(); ++s) {
    Eigen::VectorXd x = start_of(path, s);
    double t = path.path[s].start;
    for (const Impact& impact : path.path[s].impacts) {
      flight_.fly(x, t, impact.t - t);
      flight_.strike(impact.contact);
      x = flight_.x();
      t = impact.t;
      for (Eigen::Index i = 0; i < 2 * n(); ++i) {
        double& size = sizes[static_cast<std::size_t>(i)];
        size = std::max(size, std::abs(x[i]));
      }
    }
  }
  return sizes;
}

// An impact, linearized about its point and time: the time is one more Gaussian variable. The point
// becomes that after the impact.
void EventFilter::take_linearized(int contact, double t, Point& on, FilterBelief& belief) {
  const double when = t - on.tau;
  spread(belief, when - belief.t);
  linearize(when, on.z, belief, false);
  look(contact, false, when);
  belief.length = std::max(belief.length, at_.of.length);
  const Eigen::Index last = at_.X.cols() - 1;
  const double of_time = -at_.of.velocity * belief.sigma;
  at_.phi[last] = of_time;
  offset_ = belief.z - on.z;
  carry(offset_);
  x_ = dx_;
  c_ = offset_.tail(unknowns());
  const double residual =
      at_.of.g + direction_.dot(dx_) + at_.by_c.dot(c_) + at_.of.velocity * on.tau;
  const double variance = at_.phi.squaredNorm() + at_.noise;
  const double gain = belief.sigma * of_time / variance;
  const double shrink = 1.0 / (1.0 + std::sqrt(at_.noise / variance));
  measure(residual, at_.noise, x_, c_);
  const double off = -gain * residual - on.tau;
  onward_.set(on.z.tail(unknowns()), true);
  onward_.fly(at_.x, when, 0.0);
  onward_.strike(contact);
  Eigen::Index columns = 0;
  for (Eigen::Index j = 0; j <= last; ++j) {
    const double of_tau = (j == last ? belief.sigma : 0.0) - gain * shrink * at_.phi[j];
    dx_ = at_.X.col(j);
    onward_.carry_through(dx_);
    dx_.noalias() += onward_.by_unknowns().lazyProduct(at_.T.col(j));
    dx_ -= of_tau * onward_.by_time();
    all_.col(columns).head(2 * n()) = dx_;
    all_.col(columns++).segment(2 * n(), unknowns()) = at_.T.col(j);
  }
  onward_.carry_through(x_);
  x_ += onward_.by_unknowns() * c_ - off * onward_.by_time();
  on.z.head(2 * n()) = onward_.x();
  belief.z = on.z;
  belief.z.head(2 * n()) += x_;
  belief.z.tail(unknowns()) += c_;
  triangularize(all_, 0, size(), columns);
  belief.S = all_.topLeftCorner(size(), size());
  belief.t = when;
  belief.reported[contact] = t;
  belief.occurred[contact] = when;
}

void EventFilter::follow(const Likelihood& path, const Stretches& measured, double sigma,
                         FilterBelief& belief) {
  const std::vector<Unknown>& all = family_->unknowns();
  Eigen::VectorXd c(unknowns());
  belief = no_belief();
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const Unknown& unknown = all[static_cast<std::size_t>(k)];
    c[k] = unknown.coordinate(path.values[k]);
    belief.S(2 * n() + k, 2 * n() + k) = unknown.logarithmic ? wide_share * unknown.within : 1.0;
  }
  belief.z.tail(unknowns()) = c;
  belief.t = path.path.front().start;
  const std::vector<double> sizes = largest(path, c);
  Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(2 * n(), 2 * n());
  for (Eigen::Index i = 0; i < 2 * n(); ++i) {
    wide(i, i) = wide_state * sizes[static_cast<std::size_t>(i)];
  }
  Point on;
  on.z.resize(size());
  for (std::size_t s = 0; s < path.path.size(); ++s) {
    const Stretch& stretch = path.path[s];
    on.z << start_of(path, s), c;
    belief.sigma = sigma;
    restart(stretch.start, on.z.head(2 * n()), wide, belief);
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      const Impact& impact = stretch.impacts[k];
      const double t = measured[s].impacts[k].t;
      on.tau = t - impact.t;
      // The time of a missed impact is a guess.
      belief.sigma = impact.timed ? sigma : impact.t - belief.t;
      take_linearized(impact.contact, t, on, belief);
    }
  }
  belief.sigma = sigma;
}

// An impact of this contact may have happened and not been reported yet: both cases, weighed.
bool EventFilter::mix_impact(int contact, double t, const FilterBelief& belief) {
  look(contact, false, t);
  const double sigma = belief.sigma, s = std::sqrt(at_.phi.squaredNorm() + at_.noise);
  const double g0 = at_.of.g;
  double v = at_.of.velocity, ago = 0.0;
  if (g0 > near_gap * s || !(v < 0.0)) return false;
  // When the mean was hit.
  double g = g0;
  for (int i = 0; i < 4 && g < 0.0; ++i) {
    ago += g / v;
    linearize(t - ago, belief.z, belief);
    look(contact, false, t - ago);
    g = at_.of.g;
    v = at_.of.velocity;
    if (!(v < 0.0)) break;
  }
  const bool possible = v < 0.0 && ago >= 0.0;
  if (!possible || ago == 0.0) {
    linearize(t, belief.z, belief);
    look(contact, false, t);
    if (!possible) return false;
    v = at_.of.velocity;
  }
  const double hit = normal_cdf(-g0 / s) * normal_cdf(-ago / sigma);
  const double p = std::max(hit / (hit + normal_cdf(g0 / s) + 1e-300), least_probability);
  // What the impact adds to the mean and, by saltation, to each column.
  const Eigen::Index known = at_.X.cols() - 2;
  const double factor = -(2.0 - flight_.lost_share(contact));
  dx_.setZero();
  flight_.along(contact, dx_.tail(n()));
  const Eigen::VectorXd& along = dx_;
  const Machine& machine = flight_.machine();
  // Row i of the columns at the hit: kick and saltation, then free flight to t.
  next_ = at_.phi;
  unit_ = at_.psi;
  const double a = at_.of.acceleration;
  x_ = (factor * v) * along;
  // The columns that the hit adds, kept in the first node's room.
  Eigen::MatrixXd& added = nodes_.front().columns;
  for (Eigen::Index j = 0; j < known; ++j) {
    const double time = next_[j] / -v;
    for (Eigen::Index i = 0; i < n(); ++i) {
      const double kick = factor * v * along[n() + i];
      added(i, j) = -kick * time;
      added(n() + i, j) =
          factor * (unit_[j] + a * time) * along[n() + i] + machine.C(i, 0) * kick * time;
    }
  }
  linearize(t, belief.z, belief);
  flight_.turn(ago, x_);
  const double stay = std::sqrt(1.0 - p), changed = std::sqrt(p);
  at_.x += p * x_;
  for (Eigen::Index j = 0; j < known; ++j) {
    dx_ = added.col(j).head(2 * n());
    flight_.turn(ago, dx_);
    // Two branches of one column: without the impact and with it.
    all_.col(j).head(2 * n()) = stay * at_.X.col(j);
    all_.col(j).segment(2 * n(), unknowns()) = stay * at_.T.col(j);
    all_.col(known + j).head(2 * n()) = changed * (at_.X.col(j) + dx_);
    all_.col(known + j).segment(2 * n(), unknowns()) = changed * at_.T.col(j);
  }
  all_.col(2 * known).setZero();
  all_.col(2 * known).head(2 * n()) = (changed * stay) * x_;
  triangularize(all_, 0, size(), 2 * known + 1);
  at_.X.setZero();
  at_.T.setZero();
  at_.X.leftCols(size()) = all_.topLeftCorner(2 * n(), size());
  at_.T.leftCols(size()) = all_.block(2 * n(), 0, unknowns(), size());
  return true;
}

const Eigen::VectorXd& EventFilter::mean(double t, const FilterBelief& belief) {
  spread(belief, t - belief.t);
  linearize(t, belief.z, belief);
  published_ = at_.X.cols();
  return at_.x;
}

const Eigen::VectorXd& EventFilter::publish(double t, const FilterBelief& belief) {
  mean(t, belief);
  const Eigen::Index last = at_.X.cols() - 1;
  if (belief.burst && belief.held >= 0) {
    dx_.setZero();
    flight_.along(belief.held, dx_.tail(n()));
    at_.X.col(last) = belief.speed[belief.held] * dx_;
    return at_.x;
  }
  const double s = belief.impact_sigma;
  if (s > 0.0 && belief.held < 0 && t < belief.impact_time + publish_reach * s) {
    const double before = std::max(normal_cdf((belief.impact_time - t) / s), least_probability);
    x_ = belief.jump;
    flight_.turn(t - belief.impact_time, x_);
    at_.x -= before * x_;
    at_.X.col(last) = std::sqrt(before * (1.0 - before)) * x_;
    return at_.x;
  }
  if (!(belief.sigma > 0.0) || belief.held >= 0) return at_.x;
  for (int i = 0; i < family_->contacts(); ++i) {
    if (t - belief.reported[i] < close_reports * belief.sigma) continue;
    if (mix_impact(i, t, belief)) break;
  }
  return at_.x;
}

void EventFilter::gap_deviations(const FilterBelief& belief, Eigen::Ref<Eigen::MatrixXd> of_gaps) {
  for (int i = 0; i < family_->contacts(); ++i) {
    flight_.direction(i, false, direction_);
    of_gaps.row(i).noalias() = direction_.transpose().lazyProduct(at_.X);
    if (unknowns() == 0 || belief.held >= 0) continue;
    flight_.differences(i, false, at_.by_c, at_.rate_by_c);
    at_.by_c.noalias() -= flight_.by_unknowns().transpose().lazyProduct(direction_);
    of_gaps.row(i).noalias() += at_.by_c.transpose().lazyProduct(at_.T);
  }
}

EventFilter::Crossing EventFilter::crossing(int contact, double t, const FilterBelief& belief) {
  mean(t, belief);
  look(contact, false, t);
  return {at_.of.g, at_.of.velocity, at_.phi.norm()};
}

int EventFilter::overdue(double t, const FilterBelief& belief) {
  if (belief.held >= 0) return -1;
  mean(t, belief);
  for (int i = 0; i < family_->contacts(); ++i) {
    look(i, false, t);
    const double floor = 1e6 * at_.noise;
    const double deviation = std::sqrt(at_.phi.squaredNorm() + floor);
    if (at_.of.velocity < 0.0 &&
        at_.of.g < -silent_gaps * deviation + silent_reports * belief.sigma * at_.of.velocity) {
      return i;
    }
  }
  return -1;
}

}  // namespace sprag
