#include "sprag/detail/bound/contraction_table.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/modal_analysis.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/energy.h"

namespace sprag {
namespace {

// |A| tau of the first node, for which this many terms of the exponential series are exact to
// rounding.
constexpr double first_reach = 0.125;
constexpr int terms = 10;
constexpr int most_doublings = 48;
// A node needs at least this contraction.
constexpr double least_loss = 1e-6;
// The table ends at this norm. Longer flights are composed of several.
constexpr double enough = 0.25;

// Number of nodes from tau to 2 tau, limited by the work.
int nodes_in_octave(Eigen::Index n) {
  constexpr double work = 2e6;
  const double each = std::pow(static_cast<double>(n), 3);
  return static_cast<int>(std::clamp(work / each, 1.0, 16.0));
}

/// exp(A tau) and a bound on the norm of its error.
struct Propagator {
  Eigen::MatrixXd E;
  double error = 0.0;

  Propagator(const Eigen::MatrixXd& A, double tau) {
    const Eigen::Index n = A.rows();
    E.setIdentity(n, n);
    for (int k = terms; k > 0; --k) {
      E = tau / k * product(A, E);
      E.diagonal().array() += 1.0;
    }
    error = rounding();
  }

  /// Doubles the time. The exact matrix has a norm of at most 1.
  void square() {
    const double of_product = rounding();
    E = product(E, E);
    error = error * (2.0 + error) + of_product;
  }

  /// Upper bound on the norm of the exact matrix.
  double norm() const {
    const double n = static_cast<double>(E.rows());
    const double largest = eigenvalues(product(E.transpose(), E))[E.rows() - 1];
    const double square = largest + 8.0 * n * machine_epsilon * E.squaredNorm();
    return std::sqrt(square) + error;
  }

 private:
  // Bound on the rounding of a product of two such matrices.
  double rounding() const {
    return static_cast<double>(E.rows()) * machine_epsilon * E.squaredNorm();
  }
};

/// d/dt (omega z, z') = A (omega z, z'), without omega z where omega = 0.
Eigen::MatrixXd in_energy(const Eigen::VectorXd& omega, const Eigen::MatrixXd& C) {
  const Eigen::Index f = omega.size();
  const Eigen::Index elastic = (omega.array() > 0.0).count();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(elastic + f, elastic + f);
  Eigen::Index row = 0;
  for (Eigen::Index i = 0; i < f; ++i) {
    if (omega[i] == 0.0) continue;
    A(row, elastic + i) = omega[i];
    A(elastic + i, row) = -omega[i];
    ++row;
  }
  A.bottomRightCorner(f, f) = -C;
  return A;
}

}  // namespace

ContractionTable::ContractionTable(const Model& model) {
  const Eigen::Index f = model.coordinates();
  const MatrixR B = modal::constrained_basis(model.M.cast<Extended>(), MatrixR(f, 0), {});
  const auto [values, vectors] = eigenpairs(congruent(B, model.K.cast<Extended>()));
  VectorR kappa = values.cwiseMax(Extended(0));
  // Removes the rounding of rigid motions' stiffness, as natural_modes() does.
  kappa.head((natural_modes(model).stiffness.array() == 0.0).count()).setZero();
  const MatrixR Phi = product(B, vectors);
  const Eigen::VectorXd omega = kappa.cwiseSqrt().cast<double>();
  const MatrixR damping = congruent(Phi, model.C.cast<Extended>());
  const Eigen::MatrixXd C = (0.5L * (damping + damping.transpose())).cast<double>();
  damping_ = C.norm();
  if (damping_ == 0.0) return;

  const Eigen::MatrixXd A = in_energy(omega, C);
  const int chains = nodes_in_octave(A.rows());
  for (int chain = 0; chain < chains; ++chain) {
    double tau = first_reach / A.norm() * std::exp2(-static_cast<double>(chain) / chains);
    Propagator propagator(A, tau);
    for (int doubling = 0; doubling < most_doublings; ++doubling) {
      if (damping_ * tau > least_loss) {
        const double sigma = propagator.norm();
        if (sigma < 1.0) nodes_.push_back({tau, sigma});
        if (sigma < enough) break;
      }
      propagator.square();
      tau *= 2.0;
    }
  }
  std::sort(nodes_.begin(), nodes_.end(),
            [](const Node& a, const Node& b) { return a.tau < b.tau; });
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    nodes_[i].sigma = std::min(nodes_[i].sigma, nodes_[i - 1].sigma);
  }
}

double ContractionTable::operator()(double tau) const {
  double sigma = 1.0;
  if (nodes_.empty()) return sigma;
  const Node& last = nodes_.back();
  if (tau >= last.tau) {
    const double times = std::floor(tau / last.tau);
    sigma = std::pow(last.sigma, times);
    tau -= times * last.tau;
  }
  // Splits the flight into parts of the longest time in the table and a rest.
  while (tau >= nodes_.front().tau) {
    const auto above = std::upper_bound(nodes_.begin(), nodes_.end(), tau,
                                        [](double of, const Node& node) { return of < node.tau; });
    const Node& node = *std::prev(above);
    sigma *= node.sigma;
    tau -= node.tau;
  }
  return sigma;
}

}  // namespace sprag
