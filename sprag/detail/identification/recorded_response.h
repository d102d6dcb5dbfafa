// Motion of oscillators without contacts under one recorded input,
//
//   y'' + C y' + K y = f a(t),
//
// from rest. Identification describes a path relative to it, as it does relative to the steady
// response to harmonics. The input has gain 1 and delay 0; a gain is a factor on the response, and
// a delay shifts its time. So the response depends on C and K alone.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "sprag/detail/mechanics/polynomial_response.h"
#include "sprag/sampled_input.h"

namespace sprag {

/// The response and the input at one time, n entries each.
struct RecordedMotion {
  Eigen::VectorXd y, u, rate;  ///< y, y', y''
  InputDerivatives input{};    ///< e, e', a, ...
};

class RecordedResponse {
 public:
  /// `C` and `K` are n x n, or their diagonals n x 1 if `modal`. `force` is f, n entries. Before
  /// its first sample the input keeps the value of that sample, for `before` [s].
  RecordedResponse(const SampledInput& input, bool modal, const Eigen::MatrixXd& C,
                   const Eigen::MatrixXd& K, const Eigen::VectorXd& force, double before);

  /// The motion at time t of the record.
  void at(double t, RecordedMotion& motion) const;

  /// Mean frequency of the input (unknowns.h) [rad/s].
  double mean_frequency() const { return mean_frequency_; }

 private:
  std::size_t interval(double t) const;
  /// Force on oscillator i on interval k.
  PolynomialForce force(Eigen::Index i, std::size_t k) const;
  void tabulate_modes();
  void tabulate_coupled();
  void move(std::size_t k, double tau, RecordedMotion& motion) const;

  bool modal_;
  double mean_frequency_ = 0.0;
  Eigen::MatrixXd C_, K_;
  Eigen::VectorXd force_;
  std::vector<double> knots_;
  std::vector<InputDerivatives> pieces_;
  Eigen::MatrixXd rows_;  // 2n x knots: y over y'
};

}  // namespace sprag
