// An adaptive estimator to be made like a replica in suites of estimators.
#pragma once

#include "sprag/adaptation/adaptive_estimator.h"

namespace sprag {

/// Of a machine that may be off by 2 %, its start as uncertain as one of which a scene says
/// nothing. It makes its identifications itself, at once, unless it is told that others do.
class IdentifyingAdaptive : public AdaptiveEstimator {
 public:
  IdentifyingAdaptive(const Model& model, double h)
      : AdaptiveEstimator(scene_of(model), h, EstimatorKind::adaptive) {}

  void tick(std::span<const ContactEvent> events, AdaptiveState& state) {
    if (identifies) identify_now(*this, state, result_);
    AdaptiveEstimator::tick(events, state);
  }

  bool identifies = true;

 private:
  static Scene scene_of(const Model& model) {
    Scene scene;
    scene.model = model;
    scene.replica.q = scene.replica.u = Eigen::VectorXd::Zero(model.coordinates());
    scene.master = scene.replica;
    scene.has_master = false;
    scene.adaptation.within.setConstant(1, 0.02);
    return scene;
  }

  AdaptationResult result_;
};

}  // namespace sprag
