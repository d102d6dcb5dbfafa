#include "studies/convergence/belief_columns.h"

namespace sprag::studies {

void set_start(const Uncertainty& uncertainty, Belief& belief) {
  const Eigen::Index f = belief.q.size();
  belief.columns = 2 * f;
  belief.S_q.leftCols(belief.columns).setZero();
  belief.S_u.leftCols(belief.columns).setZero();
  belief.S_q.leftCols(f) = uncertainty.q;
  belief.S_u.middleCols(f, f) = uncertainty.u;
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

void BeliefColumns::merge(Belief& belief) {
  constexpr double least_norm = 1e-140;  // its square does not underflow
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
    if (!(norm > least_norm)) continue;
    const double head = x[0] > 0.0 ? -norm : norm;
    x[0] -= head;  // the Householder vector, in place
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

}  // namespace sprag::studies
