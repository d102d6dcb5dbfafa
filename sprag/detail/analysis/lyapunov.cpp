#include "sprag/detail/analysis/lyapunov.h"

#include <cmath>
#include <numbers>

#include "sprag/detail/analysis/variation.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// sqrt(du^T M du + Omega^2 dq^T M dq).
double length(const Eigen::MatrixXd& M, double Omega, const Variation& variation) {
  const auto energy = [&M](const auto& x) { return x.dot(M.lazyProduct(x)); };
  return std::sqrt(energy(variation.u().col(0)) + square(Omega) * energy(variation.q().col(0)));
}

}  // namespace

Instant stroboscope_instant(long k, double T) { return tick_instant(k, T) + same_instant * T; }

Eigen::MatrixXd monodromy(Master& master, double T, long k, long l,
                          std::vector<ContactEvent>& events) {
  const Eigen::Index f = master.flows().dynamics().coordinates();
  const double Omega = 2.0 * std::numbers::pi / T;
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(f, 2 * f);
  Eigen::MatrixXd u = q;
  q.leftCols(f).setIdentity();
  u.rightCols(f).diagonal().setConstant(Omega);
  Variation variation(master, 2 * f);
  variation.set(stroboscope_instant(k, T), q, u);
  for (long i = k; i < l; ++i) {
    events.clear();
    variation.advance(stroboscope_instant(i + 1, T), events);
  }
  Eigen::MatrixXd A(2 * f, 2 * f);
  A.topRows(f) = variation.q();
  A.bottomRows(f) = variation.u() / Omega;
  return A;
}

double spectral_radius(const Eigen::MatrixXd& A) {
  if (!A.allFinite()) return A.cwiseAbs().maxCoeff();
  return static_cast<double>(general_eigenvalues(A.cast<Extended>()).cwiseAbs().maxCoeff());
}

double largest_exponent(Master& master, double T, long k, long l,
                        std::vector<ContactEvent>& events) {
  const Dynamics& dynamics = master.flows().dynamics();
  const Eigen::MatrixXd& M = dynamics.model().M;
  const Eigen::Index f = dynamics.coordinates();
  const double Omega = 2.0 * std::numbers::pi / T;
  // A generic difference, which is not in an invariant subspace.
  Eigen::MatrixXd q(f, 1), u(f, 1);
  for (Eigen::Index i = 0; i < f; ++i) {
    q(i, 0) = std::cos(1.0 + static_cast<double>(i));
    u(i, 0) = Omega * std::sin(1.0 + static_cast<double>(i));
  }
  Variation variation(master, 1);
  variation.set(stroboscope_instant(k, T), q, u);
  const long first = k + (l - k) / 10;
  double sum = 0.0;
  for (long i = k; i < l; ++i) {
    const double now = length(M, Omega, variation);
    if (!(now > 0.0)) return -infinity;
    variation.scale(1.0 / now);
    events.clear();
    variation.advance(stroboscope_instant(i + 1, T), events);
    if (i >= first) sum += std::log(length(M, Omega, variation));
  }
  return sum / (static_cast<double>(l - first) * T);
}

}  // namespace sprag
