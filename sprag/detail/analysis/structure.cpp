#include "sprag/detail/analysis/structure.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Modes whose omega^2 differ by less than this fraction have no unique basis.
constexpr double repeated = 1e-9;
// Singular values below this fraction of the largest count as zero.
constexpr double independent = 1e-12;

VectorXd restitutions(const Model& model) {
  VectorXd epsilon(static_cast<Index>(model.contacts.size()));
  for (Index i = 0; i < epsilon.size(); ++i) {
    epsilon[i] = model.contacts[static_cast<std::size_t>(i)].restitution;
  }
  return epsilon;
}

MatrixXd unit_diagonal(const MatrixXd& G) {
  const VectorXd scale =
      G.diagonal().unaryExpr([](double g) { return g > 0.0 ? 1.0 / std::sqrt(g) : 1.0; });
  return scale.asDiagonal() * G * scale.asDiagonal();
}

struct Eigenmodes {
  VectorXd kappa;  // omega^2
  MatrixXd Phi;
};

Eigenmodes eigenmodes(const Model& model) {
  if (model.M.isDiagonal(0.0) && model.K.isDiagonal(0.0)) {
    const VectorXd mass = model.M.diagonal();
    return {model.K.diagonal().cwiseQuotient(mass).cwiseMax(0.0),
            mass.cwiseSqrt().cwiseInverse().asDiagonal()};
  }
  const auto [values, vectors] = eigenpairs(model.K, model.M);
  Eigenmodes modes{values.cwiseMax(0.0), vectors};
  for (double& kappa : modes.kappa) {
    if (kappa <= 1e-13 * modes.kappa.maxCoeff()) kappa = 0.0;
  }
  return modes;
}

// Modes of one frequency are any basis of their space. This chooses the basis in which as many
// modes as possible are orthogonal to all contact directions. W_hat has one column per contact.
void separate_repeated(const VectorXd& kappa, const MatrixXd& W_hat, MatrixXd& Phi) {
  const double scale = kappa.size() > 0 ? kappa.maxCoeff() : 0.0;
  std::vector<Index> order(static_cast<std::size_t>(kappa.size()));
  for (Index k = 0; k < kappa.size(); ++k) order[static_cast<std::size_t>(k)] = k;
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return kappa[a] < kappa[b]; });
  for (std::size_t first = 0, next = 0; first < order.size(); first = next) {
    const double base = kappa[order[first]];
    while (next < order.size() &&
           kappa[order[next]] - base <= repeated * std::max(base, 1e-6 * scale)) {
      ++next;
    }
    const std::vector<Index> group(order.begin() + static_cast<std::ptrdiff_t>(first),
                                   order.begin() + static_cast<std::ptrdiff_t>(next));
    if (group.size() < 2) continue;
    const MatrixXd basis = Phi(Eigen::all, group);
    const MatrixXd V = singular_values(product(W_hat.transpose(), basis)).V;
    Phi(Eigen::all, group) = product(basis, V);
  }
}

}  // namespace

Directions directions(const Dynamics& dynamics) {
  Directions result;
  const Index m = dynamics.contacts();
  if (m == 0) return result;
  MatrixXd W_hat = CholeskyFactor(dynamics.model().M).solve_L(dynamics.W());
  W_hat.colwise().normalize();
  const auto [sigma, V] = singular_values(W_hat);
  result.rank = static_cast<int>((sigma.array() > independent * sigma[0]).count());
  if (result.rank == m) {
    result.condition = sigma[0] / sigma[m - 1];
    return result;
  }
  result.condition = std::numeric_limits<double>::infinity();
  const VectorXd combination = V.col(m - 1);
  for (Index i = 0; i < m; ++i) {
    if (std::abs(combination[i]) > 1e-6) result.dependent.push_back(static_cast<int>(i));
  }
  return result;
}

std::vector<OpposingStops> opposing_stops(const Model& model) {
  std::vector<OpposingStops> found;
  const auto m = static_cast<int>(model.contacts.size());
  for (int j = 0; j < m; ++j) {
    for (int i = 0; i < j; ++i) {
      const Contact& one = model.contacts[static_cast<std::size_t>(i)];
      const Contact& other = model.contacts[static_cast<std::size_t>(j)];
      const double a = -other.w.dot(one.w) / one.w.squaredNorm();
      if (!(a > 0.0) || (other.w + a * one.w).norm() > independent * other.w.norm()) continue;
      const Harmonic& s = one.motion;
      const Harmonic& r = other.motion;
      const double swing = s.frequency == r.frequency
                               ? std::abs(std::polar(a, s.phase) * s.amplitude +
                                          std::polar(1.0, r.phase) * r.amplitude)
                               : a * std::abs(s.amplitude) + std::abs(r.amplitude);
      double moves = 0.0;
      if (one.input == other.input) {
        const double share = std::abs(a * one.input_share + other.input_share);
        if (share > independent * std::abs(other.input_share)) {
          moves = share * one.input->largest(0);
        }
      } else {
        for (const auto& [contact, factor] : {std::pair(&one, a), std::pair(&other, 1.0)}) {
          if (contact->input) {
            moves += factor * std::abs(contact->input_share) * contact->input->largest(0);
          }
        }
      }
      found.push_back({i, j, other.clearance + a * one.clearance - swing - moves});
    }
  }
  return found;
}

Monotonicity monotonicity(const Dynamics& dynamics) {
  Monotonicity result;
  const VectorXd epsilon = restitutions(dynamics.model());
  if (has_one_restitution(dynamics.model())) return result;
  result.common = false;
  result.by_speed = has_curves(dynamics.model());
  const MatrixXd G = unit_diagonal(dynamics.G());
  MatrixXd criterion;
  if (dynamics.model().law == ImpactLaw::newton) {
    const VectorXd D = (1.0 - epsilon.array()) / (1.0 + epsilon.array());
    criterion = D.asDiagonal() * G + G * D.asDiagonal();
  } else {
    criterion = G - epsilon.asDiagonal() * G * epsilon.asDiagonal();
  }
  result.margin = eigenvalues(criterion)[0];
  return result;
}

std::vector<Mode> modes(const Dynamics& dynamics) {
  const Model& model = dynamics.model();
  auto [kappa, Phi] = eigenmodes(model);
  const Index m = dynamics.contacts();
  if (m > 0) {
    const VectorXd lengths = dynamics.G().diagonal().cwiseSqrt();
    separate_repeated(kappa, dynamics.W() * lengths.cwiseInverse().asDiagonal(), Phi);
  }
  const MatrixXd projections = product(dynamics.W().transpose(), Phi);  // m x f
  const VectorXd best = m > 0 ? VectorXd(projections.cwiseAbs().rowwise().maxCoeff()) : VectorXd();

  std::vector<Mode> result(static_cast<std::size_t>(kappa.size()));
  for (Index k = 0; k < kappa.size(); ++k) {
    Mode& mode = result[static_cast<std::size_t>(k)];
    mode.omega = std::sqrt(kappa[k]);
    const double delta = 0.5 * Phi.col(k).dot(model.C * Phi.col(k));
    mode.decades = decades_of_V(slow_root(std::max(delta, 0.0), kappa[k]));
    for (Index i = 0; i < m; ++i) {
      const double seen = std::abs(projections(i, k)) / best[i];
      if (mode.contact >= 0 && !(seen > mode.seen)) continue;
      mode.contact = static_cast<int>(i);
      mode.projection = projections(i, k);
      mode.seen = seen;
    }
  }
  return result;
}

double slow_root(double delta, double kappa) {
  const double discriminant = delta * delta - kappa;
  if (!(discriminant > 0.0)) return -delta;
  return -kappa / (delta + std::sqrt(discriminant));
}

double slow_root(const Flow& free_flight) {
  double slowest = -std::numeric_limits<double>::infinity();
  const auto& bank = free_flight.oscillators();
  for (Index k = 0; k < free_flight.modes(); ++k) {
    const Index i = free_flight.frequencies() + k;
    slowest = std::max(slowest, slow_root(bank.delta()[i], bank.kappa()[i]));
  }
  return slowest;
}

double decades_of_V(double real_part) {
  // Avoids a negative zero.
  return real_part == 0.0 ? 0.0 : -2.0 * real_part / std::numbers::ln10;
}

}  // namespace sprag
