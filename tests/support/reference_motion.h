// The machine's motion with locked contacts, by Taylor series of the equation of motion in extended
// precision and in physical coordinates. It is independent of the library's modal analysis.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/model.h"

namespace sprag {

class ReferenceMotion {
 public:
  using Real = long double;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

  /// At t = 0; gamma of the locked contacts must be zero.
  ReferenceMotion(const Model& model, const std::vector<int>& locked, const State& start,
                  Real t = 0);

  void advance(Real tau);

  const Vector& q() const { return q_; }
  const Vector& u() const { return u_; }

  /// Forces of the locked contacts, in the order of the list.
  Vector lambda() const;

 private:
  Eigen::Index contacts() const { return static_cast<Eigen::Index>(locked_.size()); }
  const Contact& contact(Eigen::Index i) const;
  Real derivative(const Harmonic& harmonic, int k) const;
  Vector derivative(int k) const;
  Vector solve(const Vector& force, int k) const;
  void step(Real h);

  const Model& model_;
  std::vector<int> locked_;
  Matrix kkt_, inverse_, C_, K_;
  Vector q_, u_;
  Real t_;
  Real longest_ = 1;
};

}  // namespace sprag
