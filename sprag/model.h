/// \file
/// \brief The machine: M u' + C u + K q = W lambda + f(t), q' = u (Baumann & Leine 2014, eq. (2)).
///
/// Contact i has the gap g_i = w_i^T q + s_i(t) + c_i and the gap velocity
/// gamma_i = w_i^T u + s_i'(t). Contacts are counted from 0. Units are the scene's own, consistent;
/// the shipped scenes use SI.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"
#include "sprag/sampled_input.h"

namespace sprag {

/// \brief amplitude cos(frequency t + phase).
struct Harmonic {
  double amplitude = 0.0;  ///< in the unit of the quantity
  double frequency = 0.0;  ///< >= 0 [rad per unit of time]
  double phase = 0.0;      ///< [rad]
};

/// \brief Adds direction (constant + harmonic(t) + input(t)) to f(t).
struct Force {
  Eigen::VectorXd direction;       ///< f entries
  double constant = 0.0;           ///< constant part
  Harmonic harmonic;               ///< harmonic part
  SampledInputPointer input = {};  ///< sampled part a(t); null: none
};

/// \brief How a restitution depends on the speed v = max(-gamma-, 0) of the approach. Either
/// epsilon(v) = max(epsilon(0) + slope v, 0), or a piecewise linear curve, constant outside.
///
/// Two motions do not part in an impact if |d(epsilon v)/dv| <= 1 (largest_change()).
struct RestitutionCurve {
  double slope = 0.0;              ///< d epsilon / dv <= 0 [s/m]; 0 with a piecewise linear curve
  std::vector<double> at = {};     ///< speeds of its points, >= 0, ascending [m/s]
  std::vector<double> value = {};  ///< epsilon(v) there, up to a factor: the first is epsilon(0)

  /// \brief Whether the restitution is the same at every speed.
  /// \return true if it is.
  bool is_constant() const { return slope == 0.0 && at.empty(); }
};

/// \brief One unilateral contact.
struct Contact {
  Eigen::VectorXd w;         ///< contact direction w_i, f entries
  double clearance = 0.0;    ///< c_i [m]
  Harmonic motion;           ///< s_i(t) [m], motion of the support against the coordinates' frame
  double restitution = 0.0;  ///< epsilon_i in [0, 1], of the slowest impacts
  /// \brief Restitution of the replica's pulses, in [-1, 1], for a replica with fewer modes than
  /// its machine (reduction.h). Empty: epsilon_i. Events of kind `closes` have restitution 0
  /// anyway.
  std::optional<double> replica_restitution = {};
  SampledInputPointer input = {};  ///< adds input_share e(t) to s_i(t); null: none
  double input_share = 0.0;        ///< 0 without an input
  RestitutionCurve curve = {};     ///< restitution of faster impacts
};

/// \brief Restitution of one impact.
struct ImpactRestitution {
  double epsilon = 0.0;  ///< epsilon(v)
  double slope = 0.0;    ///< d epsilon / dv [s/m]; d(epsilon v)/dv = epsilon - slope gamma
  double scatter = 0.0;  ///< standard deviation of epsilon v about this line, for an uncertain v
};
/// \brief Restitution of a contact at an impact, eq. (6) with epsilon = epsilon(v).
/// \param contact the contact.
/// \param gamma gap velocity before the impact [m/s]; v = max(-gamma, 0).
/// \return epsilon(v) and its slope; at a point of the curve that of faster impacts.
ImpactRestitution restitution_at(const Contact& contact, double gamma);
/// \brief The same for a gap velocity that is known to a standard deviation: the line through
/// epsilon v with the same mean, and the same covariance with v.
/// \param contact the contact.
/// \param gamma mean of the gap velocity before the impact [m/s].
/// \param sigma its standard deviation [m/s].
/// \return restitution_at(contact, gamma) without a curve or a deviation.
ImpactRestitution restitution_over(const Contact& contact, double gamma, double sigma);
/// \brief Largest |d(epsilon v)/dv|: at most 1 if an impact does not increase a distance.
/// \param contact the contact.
/// \return the largest over all v.
double largest_change(const Contact& contact);
/// \brief Largest restitution of a contact.
/// \param contact the contact.
/// \return the largest epsilon(v) over all v.
double largest_restitution(const Contact& contact);

/// \brief Restitution that a replica uses for pulses.
/// \param contact the contact.
/// \param gamma gap velocity of the replica before the impact [m/s].
/// \return Contact::replica_restitution, or restitution_at() if that is empty.
inline double restitution_of_replica(const Contact& contact, double gamma = 0.0) {
  return contact.replica_restitution.value_or(restitution_at(contact, gamma).epsilon);
}

/// \brief A named quantity: direction^T q or direction^T u.
struct Output {
  std::string name;           ///< as in the scene file
  Eigen::VectorXd direction;  ///< f entries
  bool velocity = false;      ///< direction^T u instead of direction^T q
  std::string unit{};         ///< in titles of pictures; empty: not given
};

/// \brief Impact law. Both coincide for an impact of one contact alone.
enum class ImpactLaw {
  poisson,  ///< impulse of the expansion = epsilon times that of the compression
  newton    ///< gamma+ = -epsilon gamma-
};

/// \brief Constant data of a machine with f coordinates and m = contacts.size() contacts.
///
/// M is symmetric positive definite. C and K are symmetric positive semidefinite. All are f x f.
struct Model {
  Eigen::MatrixXd M, C, K;             ///< mass, damping and stiffness matrix
  std::vector<Force> forces;           ///< their sum is f(t)
  std::vector<Contact> contacts;       ///< m contacts
  ImpactLaw law = ImpactLaw::poisson;  ///< impact law of all contacts
  double chatter_time = 1e-8;  ///< a chatter whose remainder is shorter is completed [s]; a scene
                               ///< without it takes 1e-8 time_scale() (scale.h)
  std::vector<Output> outputs = {};  ///< named quantities

  /// \brief Number of coordinates.
  /// \return f.
  Eigen::Index coordinates() const { return M.rows(); }
};

/// \brief Whether the machine has no input: no force, no clearance and no motion of a support.
///
/// The event times of such a machine do not depend on the scale of its motion.
/// \param model the machine.
/// \return true if it has none.
inline bool is_homogeneous(const Model& model) {
  const auto no_force = [](const Force& force) {
    return (force.constant == 0.0 && force.harmonic.amplitude == 0.0 && !force.input) ||
           force.direction.isZero(0.0);
  };
  const auto at_zero = [](const Contact& contact) {
    return contact.clearance == 0.0 && contact.motion.amplitude == 0.0 && !contact.input;
  };
  return std::all_of(model.forces.begin(), model.forces.end(), no_force) &&
         std::all_of(model.contacts.begin(), model.contacts.end(), at_zero);
}

/// \brief State of a machine.
struct State {
  Eigen::VectorXd q, u;  ///< coordinates and velocities, f entries each
};

/// \brief The machine has no exact flow, or a computation does not apply to it: M not positive
/// definite, defective modes, damping that couples the modes, ... what() gives the reason.
struct ModelError : Error {
  using Error::Error;
};

/// \brief Value of an output.
/// \param output the output.
/// \param q coordinates, f entries.
/// \param u velocities, f entries.
/// \return direction^T q or direction^T u.
double value(const Output& output, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u);

/// \brief Value of a harmonic at time t.
/// \param harmonic the harmonic.
/// \param t time [s].
/// \return amplitude cos(frequency t + phase).
inline double value(const Harmonic& harmonic, double t) {
  return harmonic.amplitude * std::cos(harmonic.frequency * t + harmonic.phase);
}
/// \brief Time derivative of a harmonic at time t.
/// \param harmonic the harmonic.
/// \param t time [s].
/// \return -amplitude frequency sin(frequency t + phase).
inline double rate(const Harmonic& harmonic, double t) {
  return -harmonic.amplitude * harmonic.frequency *
         std::sin(harmonic.frequency * t + harmonic.phase);
}

/// \brief Second time derivative of a harmonic, as a harmonic.
/// \param harmonic the harmonic.
/// \return its second derivative.
inline Harmonic second_derivative(const Harmonic& harmonic) {
  return {-harmonic.amplitude * harmonic.frequency * harmonic.frequency, harmonic.frequency,
          harmonic.phase};
}

/// \brief Motion of a contact's support.
/// \param contact the contact.
/// \param t time [s].
/// \return s_i(t) [m].
inline double support_motion(const Contact& contact, double t) {
  const double harmonic = value(contact.motion, t);
  return contact.input ? harmonic + contact.input_share * contact.input->displacement(t) : harmonic;
}
/// \brief Velocity of a contact's support.
/// \param contact the contact.
/// \param t time [s].
/// \return s_i'(t) [m/s].
inline double support_velocity(const Contact& contact, double t) {
  const double harmonic = rate(contact.motion, t);
  return contact.input ? harmonic + contact.input_share * contact.input->velocity(t) : harmonic;
}
/// \brief Whether a restitution depends on the speed.
/// \param model the machine.
/// \return true if that of one contact does.
bool has_curves(const Model& model);
/// \brief Whether a sampled input acts on the machine.
/// \param model the machine.
/// \return true if a force or a support has one.
bool has_sampled_inputs(const Model& model);
/// \brief End of the time for which all inputs of a machine are given.
/// \param model the machine.
/// \return the earliest SampledInput::end() of its inputs, else infinity [s].
double end_of_inputs(const Model& model);

/// \brief Gap g_i(q, t).
/// \param contact the contact.
/// \param q coordinates, f entries.
/// \param t time [s].
/// \return the gap [m]; negative inside the support.
inline double gap(const Contact& contact, const Eigen::VectorXd& q, double t) {
  return contact.w.dot(q) + support_motion(contact, t) + contact.clearance;
}
/// \brief Scale of the rounding errors of a gap.
/// \param contact the contact.
/// \param q coordinates, f entries.
/// \return upper bound over all t of the sum of the absolute terms of g_i(q, t) [m].
double gap_scale(const Contact& contact, const Eigen::VectorXd& q);
/// \brief Gap velocity gamma_i(u, t).
/// \param contact the contact.
/// \param u velocities, f entries.
/// \param t time [s].
/// \return the gap velocity [m/s].
inline double gap_velocity(const Contact& contact, const Eigen::VectorXd& u, double t) {
  return contact.w.dot(u) + support_velocity(contact, t);
}

}  // namespace sprag
