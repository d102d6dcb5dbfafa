// Beliefs for tests, with q above u in one vector and S_q above S_u in one matrix.
#pragma once

#include <Eigen/Core>

#include "sprag/estimation/belief.h"
#include "sprag/estimation/event_mixture.h"

namespace sprag {

/// Mean m, 2 f entries, and S, 2 f rows, with room for what merging leaves and an event adds.
inline Belief belief_of(const Eigen::VectorXd& m, const Eigen::MatrixXd& S) {
  const Eigen::Index f = m.size() / 2;
  Belief belief;
  belief.q = m.head(f);
  belief.u = m.tail(f);
  belief.columns = S.cols();
  belief.S_q.setZero(f, 8 * f + Belief::most_components + EventMixture::added_columns(8 * f));
  belief.S_u = belief.S_q;
  belief.S_q.leftCols(S.cols()) = S.topRows(f);
  belief.S_u.leftCols(S.cols()) = S.bottomRows(f);
  return belief;
}

inline Eigen::VectorXd mean_of(const Belief& belief) {
  Eigen::VectorXd mean(2 * belief.q.size());
  mean << belief.q, belief.u;
  return mean;
}

/// 2 f x count.
inline Eigen::MatrixXd columns_of(const Belief& belief, Eigen::Index first, Eigen::Index count) {
  Eigen::MatrixXd S(2 * belief.q.size(), count);
  S << belief.S_q.middleCols(first, count), belief.S_u.middleCols(first, count);
  return S;
}

inline Eigen::MatrixXd covariance_of(const Belief& belief) {
  const Eigen::MatrixXd S = columns_of(belief, 0, belief.columns);
  return S * S.transpose();
}

}  // namespace sprag
