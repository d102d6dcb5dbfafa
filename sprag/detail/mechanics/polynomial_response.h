// Response of one oscillator to a polynomial force,
//
//   z'' + 2 delta z' + kappa z = F(tau),   F = sum_n F_n tau^n / n!,   n = 0..5,
//
// in closed form:
//
//   z  = zz z_0 + zv v_0 + sum_n F_n S_n,   z' = vz z_0 + vv v_0 + sum_n F_n S_(n-1),
//
// where S_n is the response to tau^n / n! from rest, and S_(-1) = zv. All are computed in extended
// precision: no digits of double precision cancel in any regime of damping and stiffness.
#pragma once

#include <array>
#include <cstddef>

namespace sprag {

inline constexpr std::size_t polynomial_terms = 6;

/// F_0 to F_5: the force and its derivatives.
using PolynomialForce = std::array<double, polynomial_terms>;

/// The propagator over a fixed tau >= 0.
struct PolynomialStep {
  long double zz, zv, vz, vv;
  std::array<long double, polynomial_terms> S;  ///< S_0 to S_5

  /// Moves (z, v) under a force whose derivatives at the start are F.
  void apply(const PolynomialForce& F, long double& z, long double& v) const {
    long double moved_z = zz * z + zv * v + F[0] * S[0];
    long double moved_v = vz * z + vv * v + F[0] * zv;
    for (std::size_t n = 1; n < polynomial_terms; ++n) {
      moved_z += F[n] * S[n];
      moved_v += F[n] * S[n - 1];
    }
    z = moved_z;
    v = moved_v;
  }
};

/// Requires delta, kappa, tau >= 0.
PolynomialStep polynomial_step(long double delta, long double kappa, long double tau);

/// Moves (z, v) by tau in double precision, tau of any sign but not much longer than an interval
/// between samples backwards. Uses the series of the motion itself while tau is short against the
/// oscillator's times, else the closed form.
void move_under_force(double delta, double kappa, const PolynomialForce& F, double tau, double& z,
                      double& v);

}  // namespace sprag
