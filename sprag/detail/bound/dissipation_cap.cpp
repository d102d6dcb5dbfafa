#include "sprag/detail/bound/dissipation_cap.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using std::complex;

constexpr double least_alpha = 1e-3, most_alpha = 0.95;  // share of the lowest frequency
// With more coordinates an eigenvalue problem takes milliseconds.
constexpr Eigen::Index few_coordinates = 12;

// Smallest eigenvalue of Q x = value P x.
double smallest(const Eigen::MatrixXd& Q, const Eigen::MatrixXd& P) {
  const CholeskyFactor factor(P);
  if (!factor.exists()) return -infinity;
  const Eigen::MatrixXd B = factor.solve_L(factor.solve_L(Q).transpose());
  return eigenvalues(0.5 * (B + B.transpose()))[0];
}

// The same for one mode.
double smallest_of_mode(double a, double b, double d, double p) {
  // det(Q - x P) with Q = [a b; b d], P = [1 p; p 1].
  const double A = 1.0 - p * p;
  const double B = a + d - 2.0 * b * p;
  const double C = a * d - b * b;
  const double root = std::sqrt(std::max(B * B - 4.0 * A * C, 0.0));
  return B > 0.0 ? 2.0 * C / (B + root) : (B - root) / (2.0 * A);
}

double rho_at(const EnergyMetric& metric, double alpha, double k, double c) {
  const Eigen::VectorXd& omega = metric.omega();
  const Eigen::Index f = omega.size();
  if (metric.decoupled()) {
    double rho = infinity;
    for (Eigen::Index i = 0; i < f; ++i) {
      const double d = metric.D()(i, i);
      const double cross = alpha * (1.0 + c) * d / omega[i] + k * omega[i];
      rho = std::min(rho, smallest_of_mode(2.0 * alpha * (1.0 + k), cross,
                                           2.0 * (1.0 + c) * d - 2.0 * alpha, alpha / omega[i]));
    }
    return 0.5 * rho;
  }
  Eigen::MatrixXd P = Eigen::MatrixXd::Identity(2 * f, 2 * f);
  P.topRightCorner(f, f) = (alpha * omega.cwiseInverse()).asDiagonal();
  P.bottomLeftCorner(f, f) = P.topRightCorner(f, f);
  Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(2 * f, 2 * f);
  Q.topLeftCorner(f, f).diagonal().setConstant(2.0 * alpha * (1.0 + k));
  Q.topRightCorner(f, f) = alpha * (1.0 + c) * omega.cwiseInverse().asDiagonal() * metric.D();
  Q.topRightCorner(f, f).diagonal() += k * omega;
  Q.bottomLeftCorner(f, f) = Q.topRightCorner(f, f).transpose();
  Q.bottomRightCorner(f, f) = 2.0 * (1.0 + c) * metric.D();
  Q.bottomRightCorner(f, f).diagonal().array() -= 2.0 * alpha;
  return 0.5 * smallest(Q, P);
}

// Supremum over phi of |Re(a e^(i phi))|.
double largest_of(const Eigen::VectorXcd& a) {
  const double rr = a.real().squaredNorm();
  const double ii = a.imag().squaredNorm();
  const double ri = a.real().dot(a.imag());
  return std::sqrt(0.5 * (rr + ii) + std::hypot(0.5 * (rr - ii), ri));
}

// Z^-1 B with Z = omega^2 + i Omega D - Omega^2.
Eigen::MatrixXcd solve_impedance(const EnergyMetric& metric, double Omega,
                                 const Eigen::MatrixXcd& B) {
  const Eigen::VectorXcd diagonal = metric.omega().cwiseAbs2().array() - square(Omega) +
                                    complex<double>(0.0, Omega) * metric.D().diagonal().array();
  if (metric.decoupled()) return diagonal.cwiseInverse().asDiagonal() * B;
  MatrixCR Z = (complex<double>(0.0, Omega) * metric.D()).cast<complex<Extended>>();
  Z.diagonal() = diagonal.cast<complex<Extended>>();
  return solve(Z, B.cast<complex<Extended>>().eval()).cast<complex<double>>();
}

// A^-1 b for a Hermitian, positive semidefinite A; the smallest solution where A is singular.
Eigen::VectorXcd solve_semidefinite(const Eigen::MatrixXcd& A, const Eigen::VectorXcd& b) {
  const Eigen::Index m = A.rows();
  if (m == 0) return b;
  Eigen::MatrixXd real(2 * m, 2 * m);
  real << A.real(), -A.imag(), A.imag(), A.real();
  Eigen::VectorXd parts(2 * m);
  parts << b.real(), b.imag();
  const auto [values, vectors] = eigenpairs(real, Eigen::MatrixXd::Identity(2 * m, 2 * m));
  const Eigen::VectorXd inverse =
      (values.array() > dependent_share * values[2 * m - 1]).select(values.cwiseInverse(), 0.0);
  const Eigen::VectorXd y = inverse.cwiseProduct(vectors.transpose().lazyProduct(parts));
  const Eigen::VectorXd x = vectors.lazyProduct(y);
  return x.head(m) + complex<double>(0.0, 1.0) * x.tail(m);
}

}  // namespace

Decay slowest_decay(const EnergyMetric& metric, const Tolerance& tolerance) {
  const double lowest = metric.omega().minCoeff();
  if (!(lowest > 0.0)) return {};
  const auto of = [&](double alpha) {
    double rho = infinity;
    for (const double k : {-tolerance.stiffness, tolerance.stiffness}) {
      for (const double c : {-tolerance.damping, tolerance.damping}) {
        rho = std::min(rho, rho_at(metric, alpha, k, c));
      }
    }
    return rho;
  };
  const int nodes = metric.decoupled() || metric.coordinates() <= few_coordinates ? 60 : 16;
  Decay best;
  double largest = 0.0;
  for (int i = 0; i < nodes; ++i) {
    const double share = static_cast<double>(i) / (nodes - 1);
    const double alpha = lowest * least_alpha * std::pow(most_alpha / least_alpha, share);
    const double rho = of(alpha);
    const double value = rho * std::sqrt(1.0 - alpha / lowest);
    if (value <= largest) continue;
    largest = value;
    best = {rho, alpha};
  }
  best.rho *= 1.0 - share_of_rounding;
  return best;
}

DissipationCap::DissipationCap(const EnergyMetric& metric, const Tolerance& tolerance)
    : metric_(&metric) {
  const Eigen::Index f = metric.coordinates();
  rest_.setZero(f);
  swing_.setZero(f, metric.dynamics().frequencies().size());
  const Decay decay = slowest_decay(metric, tolerance);
  if (decay.rho <= 0.0) return;
  alpha_ = decay.alpha;
  find_admissible(tolerance);
  if (!admissible_) return;
  rho_ = decay.rho;
  find_force(tolerance);
  const double tilt = alpha_ / metric.omega().minCoeff();
  root_low_ = std::sqrt(1.0 - tilt);
  root_high_ = std::sqrt(1.0 + tilt);
}

// Finds q^ = rest + swing, which has constant gaps. `rest` minimizes |f_0 - K q| among all
// positions with gaps >= 0 for the smallest tolerated clearances.
void DissipationCap::find_admissible(const Tolerance& tolerance) {
  const EnergyMetric& metric = *metric_;
  const Dynamics& dynamics = metric.dynamics();
  const Eigen::MatrixXd& W = metric.W();
  const Eigen::Index m = W.cols();
  const Eigen::VectorXd stiffness = metric.omega().cwiseAbs2();
  // The sampled motion of a support is not bounded in advance: no cap.
  if (!dynamics.inputs().empty() && !dynamics.inputs().motions().isZero(0.0)) return;
  if (!follow_supports()) return;
  const Eigen::MatrixXd away = stiffness.cwiseAbs2().cwiseInverse().asDiagonal() * W;
  const Eigen::VectorXd free = metric.force_constant().cwiseQuotient(stiffness);
  const ContactMatrix A = product(W.transpose(), away);
  const ContactVector gaps =
      (W.transpose() * free + dynamics.offsets()).array() - tolerance.clearance;
  ContactVector push, left;
  const double scale = dynamics.offsets().cwiseAbs().maxCoeff() +
                       (W.transpose() * free).cwiseAbs().maxCoeff() + tolerance.clearance;
  const ContactVector noise = ContactVector::Constant(m, 0.1 * share_of_rounding * scale);
  ContactSet unsatisfied = 0;
  if (solve_semidefinite_lcp(A, gaps, noise, push, left, unsatisfied) != Solved::yes) return;
  rest_ = free + away * push;
  // Checks the gaps of the rounded solution.
  const Eigen::VectorXd final =
      (W.transpose() * rest_ + dynamics.offsets()).array() - tolerance.clearance;
  admissible_ = final.minCoeff() >= -share_of_rounding * scale;
}

// Sets the harmonics of q^. With Z = K + i Omega C - Omega^2 (M = 1) and X = Z^-H W, the smallest
// |f - Z q| with W^T q = -s is that of
//
//   q = Z^-1 (f - X mu),   (X^H X) mu = W^T Z^-1 f + s.
//
// Returns whether the supports can be followed.
bool DissipationCap::follow_supports() {
  const EnergyMetric& metric = *metric_;
  const Dynamics& dynamics = metric.dynamics();
  const Eigen::MatrixXcd W = metric.W().cast<complex<double>>();
  const Eigen::MatrixXcd& motions = dynamics.motion_amplitudes();
  const Eigen::VectorXd& Omega = dynamics.frequencies();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const auto solve = [&](const Eigen::MatrixXcd& B) {
      return solve_impedance(metric, Omega[j], B);
    };
    const Eigen::VectorXcd free = solve(metric.force_amplitudes().col(j));
    const Eigen::MatrixXcd X = solve(W).conjugate();
    const Eigen::VectorXcd mu = solve_semidefinite(
        X.adjoint().lazyProduct(X), W.transpose().lazyProduct(free) + motions.col(j));
    swing_.col(j) = free - solve(X.lazyProduct(mu));
  }
  // Corrects what rounding and dependent directions leave.
  const auto gaps = [&] { return Eigen::MatrixXcd(W.transpose().lazyProduct(swing_) + motions); };
  const Eigen::MatrixXcd left = gaps();
  const Eigen::MatrixXcd G = dynamics.G().cast<complex<double>>();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    swing_.col(j) -= W.lazyProduct(solve_semidefinite(G, left.col(j)));
  }
  const double scale = motions.norm() + W.norm() * swing_.norm();
  return gaps().norm() <= share_of_rounding * scale;
}

void DissipationCap::find_force(const Tolerance& tolerance) {
  const EnergyMetric& metric = *metric_;
  const Eigen::VectorXd stiffness = metric.omega().cwiseAbs2();
  const Eigen::VectorXd pull = stiffness.cwiseProduct(rest_);
  double elastic = pull.norm();
  double viscous = 0.0;
  const Eigen::VectorXd& Omega = metric.dynamics().frequencies();
  Eigen::MatrixXcd harmonics = metric.force_amplitudes();
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const Eigen::VectorXcd q = swing_.col(j);
    const Eigen::VectorXcd Kq = stiffness.cast<complex<double>>().cwiseProduct(q);
    const Eigen::VectorXcd Cu = complex<double>(0.0, Omega[j]) * metric.D().lazyProduct(q);
    harmonics.col(j) += square(Omega[j]) * q - Cu - Kq;
    elastic += largest_of(Kq);
    viscous += largest_of(Cu);
  }
  double other = tolerance.force + tolerance.stiffness * elastic + tolerance.damping * viscous;
  for (Eigen::Index c = 0; c < metric.input_forces().cols(); ++c) {
    other += metric.input_forces().col(c).norm() * metric.dynamics().inputs().channel(c).largest(2);
  }
  find_limits(metric.force_constant() - pull, harmonics, other);
}

// Limits of W and J for F = |constant + Re sum of harmonics e^(i Omega t)| + other. The weight
// rho e^(-rho s) of the past leaves rho / |rho + i Omega| of a harmonic of |F - other|^2.
void DissipationCap::find_limits(const Eigen::VectorXd& constant, const Eigen::MatrixXcd& harmonics,
                                 double other) {
  const Eigen::VectorXd& Omega = metric_->dynamics().frequencies();
  const auto left = [&](double frequency) { return rho_ / std::hypot(rho_, frequency); };
  double largest = constant.norm();
  double mean = constant.squaredNorm();
  double swing = 0.0;
  for (Eigen::Index j = 0; j < Omega.size(); ++j) {
    const Eigen::VectorXcd a = harmonics.col(j);
    largest += largest_of(a);
    mean += 0.5 * a.squaredNorm();
    swing +=
        2.0 * std::abs(a.cwiseProduct(constant.cast<complex<double>>()).sum()) * left(Omega[j]);
    swing += 0.5 * std::abs(a.cwiseProduct(a).sum()) * left(2.0 * Omega[j]);
    for (Eigen::Index k = 0; k < j; ++k) {
      const Eigen::VectorXcd b = harmonics.col(k);
      swing += std::abs(a.cwiseProduct(b).sum()) * left(Omega[j] + Omega[k]);
      swing += std::abs(a.dot(b)) * left(Omega[j] - Omega[k]);
    }
  }
  const double scale = 1.0 / (std::sqrt(2.0) * rho_);
  largest_ = scale * (largest + other);
  ultimate_ = scale * (std::min(std::sqrt(mean + swing), largest) + other);
  least_ = scale * other;
  if (mean > swing) least_ += scale * (mean - swing) / largest;
}

// F is at most its largest value, and W - J decays.
double DissipationCap::advance(double W, double duration) const {
  if (!exists()) return infinity;
  const double decay = std::exp(-rho_ * duration);
  return std::min(largest_ + (W - largest_) * decay, ultimate_ + (W - least_) * decay);
}

double DissipationCap::at_any_later_time(double W) const {
  if (!exists()) return infinity;
  return std::min(std::max(W, largest_), ultimate_ + std::max(W - least_, 0.0));
}

DissipationCap::Parts DissipationCap::apart(const ModalState& state, double t) const {
  const EnergyMetric& metric = *metric_;
  const Eigen::VectorXd& omega = metric.omega();
  const Eigen::VectorXd& Omega = metric.dynamics().frequencies();
  Parts parts;
  double cross = 0.0;
  for (Eigen::Index i = 0; i < omega.size(); ++i) {
    double e = state.z[i] - rest_[i];
    double v = state.v[i];
    for (Eigen::Index j = 0; j < Omega.size(); ++j) {
      const complex<double> q = swing_(i, j) * std::polar(1.0, Omega[j] * t);
      e -= q.real();
      v += Omega[j] * q.imag();
    }
    parts.norm2 += 0.5 * (square(omega[i] * e) + square(v));
    cross += v * e;
  }
  parts.P2 = std::max(parts.norm2 + alpha_ * cross, 0.0);
  return parts;
}

double DissipationCap::from_distance(double b, const ModalState& state, double t) const {
  return exists() ? std::sqrt(apart(state, t).P2) + root_high_ * b : infinity;
}

double DissipationCap::distance(double W, const ModalState& state, double t) const {
  return exists() ? W / root_low_ + std::sqrt(apart(state, t).norm2) : infinity;
}

}  // namespace sprag
