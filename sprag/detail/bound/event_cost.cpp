#include "sprag/detail/bound/event_cost.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

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
  const ContactMatrix of = with_unit_diagonal(G, contacts);
  if (of.rows() == 1) return 1.0;
  const Eigen::SelfAdjointEigenSolver<ContactMatrix> solver(of, Eigen::EigenvaluesOnly);
  const double least = solver.eigenvalues()[0];
  const double most = solver.eigenvalues()[of.rows() - 1];
  return least > dependent_share * most ? std::sqrt(most / least) * (1.0 + dependent_share)
                                        : infinity;
}

double joint_expansion(const Eigen::MatrixXd& G, ContactSet contacts, double epsilon) {
  if (epsilon == 0.0) return 1.0;
  return std::max(1.0, epsilon * contact_coupling(G, contacts));
}

double restitution_spread(const Eigen::MatrixXd& G, ContactSet contacts) {
  const ContactMatrix of = with_unit_diagonal(G, contacts);
  if (of.rows() == 1) return 1.0;
  const Eigen::LLT<ContactMatrix> factor(of);
  if (factor.info() != Eigen::Success) return infinity;
  ContactMatrix inverse = ContactMatrix::Identity(of.rows(), of.rows());
  factor.matrixL().solveInPlace(inverse);
  // sum_i y_i <= |L^-1 (1, ..., 1)| |y|_G, and |L^-1| is at most its Frobenius norm.
  return std::sqrt(static_cast<double>(of.rows())) * inverse.norm();
}

}  // namespace sprag
