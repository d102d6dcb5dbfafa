#include "sprag/detail/bound/event_cost.h"

#include <Eigen/Jacobi>
#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Jacobi rotations converge in fewer sweeps, for 60 contacts too; an entry that is no number never
// does.
constexpr int most_sweeps = 30;

// G of these contacts, scaled to a unit diagonal.
ContactMatrix with_unit_diagonal(const Eigen::MatrixXd& G, ContactSet contacts) {
  ContactMatrix of = of_contacts(G, contacts);
  const ContactVector root = of.diagonal().cwiseSqrt();
  of.array().colwise() /= root.array();
  of.array().rowwise() /= root.transpose().array();
  return of;
}

}  // namespace

Approach approach(const Motion& free, int contact, double delta) {
  const SignalRange gamma = range(free.flow->gap_velocity(contact), free, delta);
  return {.fastest = std::max(0.0, -gamma.low),
          .slowest = gamma.low,
          .highest = gamma.high,
          .rate = std::max(std::abs(gamma.rate_low), std::abs(gamma.rate_high)),
          .rate_up = std::max(0.0, gamma.rate_high),
          .second = gamma.second};
}

EventCost single_cost(const EnergyMetric& metric, const Tolerance& tolerance, SingleEvent kind,
                      int contact, double epsilon, const Approach& approach, double rho) {
  const double root = std::sqrt(2.0 * metric.dynamics().G()(contact, contact));
  // The path moves away from the contact in the whole window: neither machine nor replica has an
  // impact.
  if (approach.slowest > root * rho) return {};
  const double g = approach.fastest + root * rho;
  const double widened = root * metric.omega_gamma(contact) * rho;
  const bool stays = kind == SingleEvent::closes;
  const double a = (stays ? approach.rate_up : approach.rate) + widened;
  const double turn = std::hypot(metric.omega_R(contact) * g, a + metric.omega_D(contact) * g);
  const double kept = stays ? 1.0 : 1.0 + epsilon;
  const double off = stays ? 0.0 : tolerance.restitution;
  return {.D = tolerance.time * kept * turn / root,
          .J = std::min(kept + off, 2.0) * g / root,
          .E = off * g / root};
}

EventCost opening_cost(const EnergyMetric& metric, const Tolerance& tolerance, int contact,
                       double free_acceleration, double speed, double rho) {
  const double root = std::sqrt(2.0 * metric.dynamics().G()(contact, contact));
  const double delta = tolerance.time;
  const double turn = metric.omega_gamma(contact);
  const double change = delta * (root * turn * speed + metric.gap_jerk(contact));
  return {.D = delta * ((std::max(0.0, -free_acceleration) + change) / root + turn * rho)};
}

double distance_to_rest(const Eigen::MatrixXd& G, ContactSet contacts, const ContactVector& gamma) {
  if (gamma.size() == 0 || gamma.minCoeff() >= 0.0) return 0.0;
  const ContactMatrix of = of_contacts(G, contacts);
  ContactVector Lambda, after;
  if (solve_lcp(of, gamma, Lambda, after) != Solved::yes) return infinity;
  return std::sqrt(std::max(0.5 * Lambda.dot(of * Lambda), 0.0));
}

double largest_change(const Model& model) {
  double largest = 0.0;
  for (const Contact& contact : model.contacts)
    largest = std::max(largest, largest_change(contact));
  return largest;
}

double contact_coupling(const Eigen::MatrixXd& G, ContactSet contacts) {
  ContactMatrix A = with_unit_diagonal(G, contacts);
  if (A.rows() == 1) return 1.0;
  // The eigenvalues, by cyclic Jacobi rotations, which need no memory.
  bool rotated = true;
  for (int sweep = 0; rotated && sweep < most_sweeps; ++sweep) {
    rotated = false;
    for (Eigen::Index j = 1; j < A.cols(); ++j) {
      for (Eigen::Index i = 0; i < j; ++i) {
        if (std::abs(A(i, j)) <= machine_epsilon) continue;
        Eigen::JacobiRotation<double> J;
        J.makeJacobi(A, i, j);
        A.applyOnTheLeft(i, j, J.adjoint());
        A.applyOnTheRight(i, j, J);
        A(i, j) = A(j, i) = 0.0;
        rotated = true;
      }
    }
  }
  if (rotated) return infinity;
  const double least = A.diagonal().minCoeff();
  const double most = A.diagonal().maxCoeff();
  return least > dependent_share * most ? std::sqrt(most / least) * (1.0 + dependent_share)
                                        : infinity;
}

double joint_expansion(const Eigen::MatrixXd& G, ContactSet contacts, double epsilon) {
  if (epsilon == 0.0) return 1.0;
  return std::max(1.0, epsilon * contact_coupling(G, contacts));
}

double restitution_spread(const Eigen::MatrixXd& G, ContactSet contacts) {
  ContactMatrix L = with_unit_diagonal(G, contacts);
  if (L.rows() == 1) return 1.0;
  if (!factorize(L)) return infinity;
  ContactMatrix inverse = ContactMatrix::Identity(L.rows(), L.rows());
  L.triangularView<Eigen::Lower>().solveInPlace(inverse);
  // sum_i y_i <= |L^-1 (1, ..., 1)| |y|_G, and |L^-1| is at most its Frobenius norm.
  return std::sqrt(static_cast<double>(L.rows())) * inverse.norm();
}

}  // namespace sprag
