#include "sprag/estimation/belief.h"

#include <cmath>

namespace sprag {

void set_start(const Uncertainty& uncertainty, Belief& belief) {
  const Eigen::Index f = belief.q.size();
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

BeliefColumns::BeliefColumns(const Flow& free, Eigen::Index f, Eigen::Index columns) {
  z_.setZero(f, columns);
  v_.setZero(f, columns);
  const Eigen::Index n = free.size();
  unit_z_ = {Eigen::ArrayXd::Ones(n), Eigen::ArrayXd::Zero(n)};
  unit_v_ = {Eigen::ArrayXd::Zero(n), Eigen::ArrayXd::Ones(n)};
  from_z_ = unit_z_;
  from_v_ = unit_v_;
  no_alpha_.setZero(n);
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
  flow.oscillators().propagate(unit_z_, no_alpha_, tau, nf, n, from_z_);
  flow.oscillators().propagate(unit_v_, no_alpha_, tau, nf, n, from_v_);
  for (Eigen::Index k = 0; k < c; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const double z_k = z(i, k);
      z(i, k) = from_z_.z[nf + i] * z_k + from_v_.z[nf + i] * v(i, k);
      v(i, k) = from_z_.v[nf + i] * z_k + from_v_.v[nf + i] * v(i, k);
    }
  }
  flow.state_differences(z, v, q, u);
}

void BeliefColumns::merge(Belief& belief) {
  const Eigen::Index f = belief.q.size();
  const Eigen::Index c = belief.columns;
  const Eigen::Index n = 2 * f;
  if (c <= 4 * f) return;
  auto R = merged_.topRows(c);
  R.leftCols(f) = belief.S_q.leftCols(c).transpose();
  R.rightCols(f) = belief.S_u.leftCols(c).transpose();
  for (Eigen::Index k = 0; k < n; ++k) {
    auto x = R.col(k).tail(c - k);
    const double norm = x.norm();
    if (norm == 0.0) continue;
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
  belief.columns = n;
  belief.S_q.leftCols(n) = R.topLeftCorner(n, f).transpose();
  belief.S_u.leftCols(n) = R.topRightCorner(n, f).transpose();
}

}  // namespace sprag
