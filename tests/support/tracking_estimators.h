// The tracking estimator with the constructor of a replica, for suites of estimators; and its
// belief.
#pragma once

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {

/// A scene with a model only.
inline Scene scene_of(const Model& model) {
  Scene scene;
  scene.model = model;
  scene.prior.start.q = scene.prior.start.u = Eigen::VectorXd::Zero(model.coordinates());
  scene.truth.start = scene.prior.start;
  scene.truth.given = false;
  return scene;
}

class ReplicaEstimator : public TrackingEstimator {
 public:
  ReplicaEstimator(const Scene& scene, double h)
      : TrackingEstimator(scene, h, EstimatorKind::replica) {}
  ReplicaEstimator(const Model& model, double h) : ReplicaEstimator(scene_of(model), h) {}
};

class BothEstimator : public TrackingEstimator {
 public:
  BothEstimator(const Scene& scene, double h) : TrackingEstimator(scene, h, EstimatorKind::both) {}
};

class TimingEstimator : public TrackingEstimator {
 public:
  TimingEstimator(const Scene& scene, double h)
      : TrackingEstimator(scene, h, EstimatorKind::timing) {}
};

/// Event times have a jitter of a millisecond.
class JitteringBoth : public TrackingEstimator {
 public:
  JitteringBoth(const Model& model, double h, double jitter = 1e-3)
      : TrackingEstimator(with_jitter(model, jitter), h, EstimatorKind::both) {}

 private:
  static Scene with_jitter(const Model& model, double jitter) {
    Scene scene = scene_of(model);
    scene.prior.jitter = jitter;
    return scene;
  }
};

/// The same with exact event times.
class ExactBoth : public JitteringBoth {
 public:
  ExactBoth(const Model& model, double h) : JitteringBoth(model, h, 0.0) {}
};

/// The published sigma of q, u and the gaps.
inline void deviations(TrackingEstimator& estimator, const TrackingState& state, Eigen::VectorXd& q,
                       Eigen::VectorXd& u, Eigen::VectorXd& gaps) {
  Confidence confidence = estimator.no_confidence();
  estimator.confidence(state, confidence);
  q = confidence.sigma_q;
  u = confidence.sigma_u;
  gaps = confidence.sigma_g;
}

/// Covariance of (q, u) under the assumption that no report is late, 2f x 2f.
inline Eigen::MatrixXd covariance(TrackingEstimator& estimator, const TrackingState& state) {
  Belief belief;
  estimator.belief(state, belief);
  Eigen::MatrixXd S(2 * belief.q.size(), belief.columns);
  S << belief.S_q, belief.S_u;
  return product(S, S.transpose());
}

}  // namespace sprag
