// Beliefs for tests, from mean and columns of one piece.
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
  belief.S_q.setZero(f, 8 * f + Belief::most_components + EventMixture::added_columns());
  belief.S_u = belief.S_q;
  belief.S_q.leftCols(S.cols()) = S.topRows(f);
  belief.S_u.leftCols(S.cols()) = S.bottomRows(f);
  return belief;
}

}  // namespace sprag
