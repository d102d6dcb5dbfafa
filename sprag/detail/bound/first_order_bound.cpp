#include "sprag/detail/bound/first_order_bound.h"

#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

FirstOrderBound::FirstOrderBound(const EnergyMetric& metric, const ModelDefect& defect,
                                 const Flow& free, const Tolerance& tolerance)
    : metric_(&metric),
      defect_(&defect),
      tolerance_(tolerance),
      in_(std::sqrt(1.0 + tolerance.stiffness)),
      exists_(metric.coordinates() <= most_coordinates &&
              (tolerance.time > 0.0 || tolerance.restitution > 0.0 || tolerance.stiffness > 0.0 ||
               tolerance.damping > 0.0)) {
  if (!exists_) return;
  ellipsoid_.emplace(metric, free);
  if (tolerance.stiffness > 0.0) {
    pairs_.emplace_back(metric, ToleratedFactor::stiffness, tolerance.stiffness);
  }
  if (tolerance.damping > 0.0) {
    pairs_.emplace_back(metric, ToleratedFactor::damping, tolerance.damping);
  }
  nodes_.resize(pairs_.size());
  c_.setZero(2 * metric.coordinates());
  scratch_.setZero(metric.coordinates());
}

void FirstOrderBound::start(double b, const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                            double t) {
  active_ = true;
  ellipsoid_->clear();
  for (ParameterPair& pair : pairs_) pair.start(q, u, t);
  b_ = b;
  integral_ = xi_ = m_ = 0.0;
  since_ = ellipsoid_t_ = node_t_ = t;
}

void FirstOrderBound::look(const ModalState& replica, const DefectNode& node, double t) {
  double sum = tolerance_.force * std::sqrt(0.5);
  xi_ = m_ = 0.0;
  for (std::size_t j = 0; j < pairs_.size(); ++j) {
    ParameterPair& pair = pairs_[j];
    pair.look(t, replica);
    xi_ += length(*metric_, pair.xi());
    m_ += length(*metric_, pair.m());
    sum += pair.defect(pair.m());
    for (ParameterPair& other : pairs_) sum += other.defect(pair.xi());
    nodes_[j] = {second_rate(*metric_, pair.xi()), second_rate(*metric_, pair.m())};
  }
  density_ = sum;
  acceleration_ = node.acceleration;
  node_t_ = t;
}

void FirstOrderBound::step(const ModalState& replica, const DefectNode& node, double t) {
  const double duration = t - node_t_;
  // From node to node the norms of x'' grow only by their inputs: that of xi by B (x_s + m), that
  // of m by B xi. |B x''| bounds the second rate of |B x|.
  const double path = acceleration_ + duration * std::sqrt(0.5) * defect_->force_second() +
                      std::sqrt(0.5) * defect_->sampled_variation(duration);
  double curvature = 0.0;
  for (std::size_t j = 0; j < pairs_.size(); ++j) {
    const double turned = duration * pairs_[j].rate();
    const double xi =
        (nodes_[j].xi + turned * (path + nodes_[j].m)) / (1.0 - std::min(square(turned), 0.5));
    const double m = nodes_[j].m + turned * xi;
    curvature += pairs_[j].rate() * m + defect_->lipschitz() * xi;
  }
  const double before = density_;
  look(replica, node, t);
  integral_ +=
      0.5 * duration * (before + density_) + curvature * duration * duration * duration / 12.0;
}

double FirstOrderBound::rest(double sigma, double t) const {
  return sigma * b_ + integral_ + defect_->lipschitz() * ellipsoid_->radius() * (t - since_);
}

double FirstOrderBound::distance(double sigma, double t) const {
  return rest(sigma, t) + in_ * (sigma * ellipsoid_->radius() + xi_);
}

void FirstOrderBound::settle(double sigma, double t) {
  b_ = rest(sigma, t);
  integral_ = 0.0;
  since_ = t;
}

void FirstOrderBound::arrive(const ModalState& replica, double t) {
  ellipsoid_->fly(t - ellipsoid_t_);
  ellipsoid_->update_radius();
  ellipsoid_t_ = t;
  look(replica, {}, t);
}

bool FirstOrderBound::impact(const LoneImpact& impact, double D_factor, double E_factor) {
  const int i = impact.contact;
  const double delta = tolerance_.time;
  const double root = std::sqrt(2.0 * metric_->dynamics().G()(i, i));
  const double turn = metric_->omega_gamma(i);
  const double kept = 1.0 + impact.epsilon;
  const double size = ellipsoid_->radius() + xi_;
  const double defect = impact.defect + defect_->lipschitz() * (size + m_ + impact.shift);
  const double drift = delta * defect;
  const double r = (size + drift) * std::exp(delta * metric_->damping());
  double of_set = ellipsoid_->largest_gap_velocity(i);
  for (const ParameterPair& pair : pairs_) {
    of_set += std::abs(metric_->W().col(i).dot(pair.xi().v));
  }
  const double r_gamma = of_set / root + drift + delta * turn * r;
  if (impact.near.highest + root * r_gamma >= 0.0) return false;
  ellipsoid_->impact(i, impact.epsilon);
  for (ParameterPair& pair : pairs_) pair.impact(i, impact.epsilon, impact.t);
  add_shifts(impact, D_factor, E_factor);
  ellipsoid_->update_radius();
  const double time =
      square(delta) / 2.0 * kept * (impact.near.rate * turn + impact.near.second) / root +
      2.0 * delta * kept * turn * r;
  const double restitution =
      tolerance_.restitution *
      (r_gamma + delta * (turn * impact.near.fastest + impact.near.rate) / root);
  b_ += in_ * (D_factor * time + E_factor * restitution + impact.rounding) + 4.0 * drift;
  since_ = node_t_ = impact.t + delta;
  integral_ = 0.0;
  return true;
}

// Adds the segments c and n gamma^- to the ellipsoid, and delta^2 / 2 |A c| to b.
void FirstOrderBound::add_shifts(const LoneImpact& impact, double D_factor, double E_factor) {
  const Eigen::Index f = metric_->coordinates();
  const int i = impact.contact;
  const double G = metric_->dynamics().G()(i, i);
  const auto w = metric_->W().col(i);
  const double approach = -impact.gamma;
  const double delta = tolerance_.time;
  if (delta > 0.0) {
    // n = (0, w) / (G sqrt 2), A x = (omega x_2, -omega x_1 - D x_2).
    const double scale = (1.0 + impact.epsilon) / (G * std::sqrt(2.0));
    metric_->damp(w, scratch_);
    c_.head(f) = scale * approach * metric_->omega().cwiseProduct(w);
    c_.tail(f) = scale * (impact.gamma_rate * w - approach * scratch_);
    metric_->damp(c_.tail(f), scratch_);
    const double turned =
        std::sqrt(metric_->omega().cwiseProduct(c_.tail(f)).squaredNorm() +
                  (metric_->omega().cwiseProduct(c_.head(f)) + scratch_).squaredNorm());
    b_ += in_ * square(delta) / 2.0 * turned;
    c_ *= D_factor * delta;
    ellipsoid_->add(c_);
  }
  if (tolerance_.restitution > 0.0) {
    c_.setZero();
    c_.tail(f) = E_factor * tolerance_.restitution * approach / (G * std::sqrt(2.0)) * w;
    ellipsoid_->add(c_);
  }
}

}  // namespace sprag
