// Replica and timing filter side by side, to be made like a replica in suites of estimators.
#pragma once

#include "sprag/estimation/supervised_filter.h"

namespace sprag {

/// Of a machine whose start is as uncertain as one of which a scene says nothing.
class JitteringSupervised : public SupervisedFilter {
 public:
  JitteringSupervised(const Model& model, double h, double jitter = 1e-3)
      : SupervisedFilter(model, h, uncertainty(model, jitter)) {}

 private:
  static Uncertainty uncertainty(const Model& model, double jitter) {
    Scene scene;
    scene.model = model;
    scene.replica.q = scene.replica.u = Eigen::VectorXd::Zero(model.coordinates());
    scene.jitter = jitter;
    return uncertainty_of(scene);
  }
};

/// The same with exact event times.
class ExactSupervised : public JitteringSupervised {
 public:
  ExactSupervised(const Model& model, double h) : JitteringSupervised(model, h, 0.0) {}
};

}  // namespace sprag
