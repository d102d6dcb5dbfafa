#include "sprag/estimation/belief.h"

#include <algorithm>
#include <cmath>

namespace sprag {

void set_start(const Uncertainty& uncertainty, Belief& belief) {
  const Eigen::Index f = belief.q.size();
  belief.components = 0;
  belief.columns = 2 * f;
  belief.S_q.leftCols(belief.columns).setZero();
  belief.S_u.leftCols(belief.columns).setZero();
  belief.S_q.leftCols(f) = uncertainty.q;
  belief.S_u.middleCols(f, f) = uncertainty.u;
}

void add_drift(const Uncertainty& uncertainty, double tau, Belief& belief) {
  const auto add = [&](const Eigen::MatrixXd& drift, Eigen::MatrixXd& to, Eigen::MatrixXd& other) {
    to.middleCols(belief.columns, drift.cols()) = std::sqrt(tau) * drift;
    other.middleCols(belief.columns, drift.cols()).setZero();
    belief.columns += drift.cols();
  };
  if (uncertainty.drift_q.size() == 0) return;
  add(uncertainty.drift_q, belief.S_q, belief.S_u);
  add(uncertainty.drift_u, belief.S_u, belief.S_q);
}

bool is_sane(const Belief& belief) {
  constexpr double largest = 1e100;
  const Eigen::Index c = belief.columns;
  return belief.q.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest &&
         belief.u.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest &&
         belief.S_q.leftCols(c).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest &&
         belief.S_u.leftCols(c).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < largest;
}

double variance(const Functional& of, const Belief& belief) {
  double variance = 0.0;
  for (Eigen::Index j = 0; j < belief.columns; ++j) {
    variance += square(of.a.dot(belief.S_q.col(j)) + of.b.dot(belief.S_u.col(j)));
  }
  return variance;
}

PotterUpdate::PotterUpdate(Eigen::Ref<const Eigen::VectorXd> phi, double residual, double r)
    : phi_(phi) {
  const double alpha = phi.squaredNorm() + r;
  gain_ = residual / alpha;
  shrink_ = 1.0 / (alpha * (1.0 + std::sqrt(r / alpha)));
}

void PotterUpdate::apply(Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> S) const {
  for (Eigen::Index i = 0; i < S.rows(); ++i) {
    const double along = S.row(i).dot(phi_.transpose());
    x[i] += gain_ * along;
    S.row(i) -= along * shrink_ * phi_.transpose();
  }
}

void Terms::include(const Contact& contact, const Eigen::VectorXd& q, const Eigen::VectorXd& u) {
  const double of_gap = contact.w.cwiseProduct(q).cwiseAbs().sum() +
                        std::abs(contact.motion.amplitude) + std::abs(contact.clearance);
  const double of_gap_velocity = contact.w.cwiseProduct(u).cwiseAbs().sum() +
                                 std::abs(contact.motion.amplitude * contact.motion.frequency);
  length = std::max(length, of_gap);
  speed = std::max(speed, of_gap_velocity);
}

Terms Terms::of_coordinates(const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                            double largest_w) const {
  return {std::max(length / largest_w, q.cwiseAbs().maxCoeff()),
          std::max(speed / largest_w, u.cwiseAbs().maxCoeff())};
}

double largest_terms(const Signal& signal, const Motion& motion) {
  return std::abs(signal.constant) + (signal.p * motion.x.z).abs().sum() +
         (signal.r * motion.x.v).abs().sum();
}

BeliefColumns::BeliefColumns(const Flow& free, Eigen::Index f, Eigen::Index columns) {
  z_.setZero(f, columns);
  v_.setZero(f, columns);
  const Eigen::Index n = free.size();
  kernels_.resize(n);
  merged_.setZero(columns, 2 * f);
}

void BeliefColumns::move(const Flow& flow, double tau, Belief& belief) {
  if (!(tau > 0.0)) return;
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  const Eigen::Index c = belief.columns;
  auto q = belief.S_q.leftCols(c);
  auto u = belief.S_u.leftCols(c);
  auto z = z_.topLeftCorner(n, c);
  auto v = v_.topLeftCorner(n, c);
  flow.enter_differences(q, u, z, v);
  flow.oscillators().kernels(tau, nf, n, kernels_);
  kernels_.apply(nf, z, v);
  flow.state_differences(z, v, q, u);
}

double BeliefColumns::see(const Flow& flow, const Signal& signal, const Belief& belief,
                          Eigen::VectorXd& phi) {
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  const Eigen::Index c = belief.columns;
  auto z = z_.topLeftCorner(n, c);
  auto v = v_.topLeftCorner(n, c);
  flow.enter_differences(belief.S_q.leftCols(c), belief.S_u.leftCols(c), z, v);
  const auto p = signal.p.segment(nf, n);
  const auto r = signal.r.segment(nf, n);
  double terms = 0.0;
  for (Eigen::Index k = 0; k < c; ++k) {
    phi[k] = (p * z.col(k).array()).sum() + (r * v.col(k).array()).sum();
    terms += square((p * z.col(k).array()).abs().sum() + (r * v.col(k).array()).abs().sum());
  }
  return std::sqrt(terms);
}

void BeliefColumns::merge(Belief& belief) {
  constexpr double least_norm = 1e-140;  // its square is a number
  const Eigen::Index f = belief.q.size();
  const Eigen::Index first = belief.components;
  const Eigen::Index c = belief.columns - first;
  const Eigen::Index n = 2 * f;
  if (c <= 4 * f) return;
  auto R = merged_.topRows(c);
  R.leftCols(f) = belief.S_q.middleCols(first, c).transpose();
  R.rightCols(f) = belief.S_u.middleCols(first, c).transpose();
  for (Eigen::Index k = 0; k < n; ++k) {
    auto x = R.col(k).tail(c - k);
    const double norm = x.norm();
    if (!(norm > least_norm)) continue;
    const double head = x[0] > 0.0 ? -norm : norm;
    x[0] -= head;  // the reflection's vector, in place
    const double factor = 2.0 / x.squaredNorm();
    for (Eigen::Index j = k + 1; j < n; ++j) {
      auto y = R.col(j).tail(c - k);
      y -= factor * x.dot(y) * x;
    }
    x.setZero();
    x[0] = head;
  }
  belief.columns = first + n;
  belief.S_q.middleCols(first, n) = R.topLeftCorner(n, f).transpose();
  belief.S_u.middleCols(first, n) = R.topRightCorner(n, f).transpose();
}

}  // namespace sprag
