// The machine: M u' + C u + K q = W lambda + f(t), q' = u (Baumann & Leine 2014, eq. (2)), with
// contacts g_i = w_i^T q + s_i(t) + c_i and gamma_i = w_i^T u + s_i'(t).
// Units are the scene's own, consistently (SI in the scenes that ship).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/error.h"

namespace sprag {

/// amplitude cos(frequency t + phase); frequency in rad per unit of time, >= 0.
struct Harmonic {
  double amplitude = 0.0;
  double frequency = 0.0;
  double phase = 0.0;
};

/// f(t) += direction (constant + harmonic(t)); direction has f entries.
struct Force {
  Eigen::VectorXd direction;
  double constant = 0.0;
  Harmonic harmonic;
};

/// One unilateral contact; w has f entries.
struct Contact {
  Eigen::VectorXd w;
  double clearance = 0.0;    ///< c_i [m]
  Harmonic motion;           ///< s_i(t) [m], motion of the support against the coordinates' frame
  double restitution = 0.0;  ///< epsilon_i in [0, 1]
  /// In [-1, 1]: epsilon_i of a replica's pulses, where something is left out of its machine that
  /// gives way as well (reduction.h). A contact that closes to stay takes 0 as ever.
  std::optional<double> replica_restitution = {};
};

inline double restitution_of_replica(const Contact& contact) {
  return contact.replica_restitution.value_or(contact.restitution);
}

/// A quantity with a name that somebody asks for: direction^T q or direction^T u; direction has f
/// entries.
struct Output {
  std::string name;
  Eigen::VectorXd direction;
  bool velocity = false;
};

enum class ImpactLaw { poisson, newton };

/// Constant data of a machine with f coordinates and m = contacts.size() contacts.
/// M is symmetric positive definite, C and K symmetric positive semidefinite, all f x f.
struct Model {
  Eigen::MatrixXd M, C, K;
  std::vector<Force> forces;
  std::vector<Contact> contacts;
  ImpactLaw law = ImpactLaw::poisson;
  double chatter_time = 1e-8;  ///< rest of a bounce sequence below which it is completed [s]; a
                               ///< scene that does not give it takes 1e-8 time_scale() (scale.h)
  std::vector<Output> outputs = {};

  Eigen::Index coordinates() const { return M.rows(); }
};

/// Whether nothing moves the machine but its own state: no force, no clearance and no motion of a
/// support. It is hit at the same times whatever the scale of its motion.
inline bool is_homogeneous(const Model& model) {
  const auto no_force = [](const Force& force) {
    return (force.constant == 0.0 && force.harmonic.amplitude == 0.0) ||
           force.direction.isZero(0.0);
  };
  const auto at_zero = [](const Contact& contact) {
    return contact.clearance == 0.0 && contact.motion.amplitude == 0.0;
  };
  return std::all_of(model.forces.begin(), model.forces.end(), no_force) &&
         std::all_of(model.contacts.begin(), model.contacts.end(), at_zero);
}

/// Generalized coordinates and velocities, f entries each.
struct State {
  Eigen::VectorXd q, u;
};

/// A machine whose motion has no exact flow (M not positive definite, defective modes, ...).
struct ModelError : Error {
  using Error::Error;
};

/// What the output shows of q and u, f entries each.
double value(const Output& output, const Eigen::Ref<const Eigen::VectorXd>& q,
             const Eigen::Ref<const Eigen::VectorXd>& u);

inline double value(const Harmonic& harmonic, double t) {
  return harmonic.amplitude * std::cos(harmonic.frequency * t + harmonic.phase);
}
inline double rate(const Harmonic& harmonic, double t) {
  return -harmonic.amplitude * harmonic.frequency *
         std::sin(harmonic.frequency * t + harmonic.phase);
}

inline Harmonic second_derivative(const Harmonic& harmonic) {
  return {-harmonic.amplitude * harmonic.frequency * harmonic.frequency, harmonic.frequency,
          harmonic.phase};
}

/// g_i(q, t) [m].
inline double gap(const Contact& contact, const Eigen::VectorXd& q, double t) {
  return contact.w.dot(q) + value(contact.motion, t) + contact.clearance;
}
/// The largest that the absolute terms of g_i(q, t) sum up to at any t [m]: what rounding is a
/// share of.
double gap_scale(const Contact& contact, const Eigen::VectorXd& q);
/// gamma_i(u, t) [m/s].
inline double gap_velocity(const Contact& contact, const Eigen::VectorXd& u, double t) {
  return contact.w.dot(u) + rate(contact.motion, t);
}

}  // namespace sprag
