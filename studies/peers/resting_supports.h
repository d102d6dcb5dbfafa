// The machine in coordinates in which its supports rest: x = q + r(t) with W^T r(t) = s(t), for
// programs whose contacts cannot move. The motion of the supports becomes a force on x.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/model.h"

namespace sprag::work_precision {

class RestingSupports {
 public:
  /// Throws ModelError if the supports' motions are inconsistent: W^T r = s has no solution.
  explicit RestingSupports(const Model& model);

  /// The machine of x: the same M, C, K, w and c, additional forces, no support motion.
  const Model& model() const { return model_; }

  State into(const State& start) const;  ///< (q, u) at t = 0 to (x, x')
  void out_of(double t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u) const;

 private:
  struct Motion {
    double frequency;
    Eigen::VectorXd cosine, sine;  // of r
  };

  Model model_;
  std::vector<Motion> motions_;
};

}  // namespace sprag::work_precision
