// The parameters of a scene's machine that can be wrong one at a time, and the machine with another
// value of one: M u' + C u + K q = W lambda + f(t), g_i = w_i^T q + s_i(t) + c_i, and epsilon_i.
// What a scene gives as one number keeps its unit. Where a parameter stands for several numbers
// that differ (restitutions, harmonics) or for a matrix (C, K of a general system), it is a common
// factor, nominally 1, and a phase a common shift, nominally 0.
#pragma once

#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

enum class Quantity {
  restitution,   ///< epsilon [-]
  damping,       ///< d of a beam [N s/m^2], else a factor on C
  stiffness,     ///< EI of a beam [N m^2], else a factor on K
  clearance,     ///< c_i [m]
  amplitude,     ///< of the excitation [m]; of the only harmonic, in its unit; else a factor
  phase,         ///< of the excitation or the only harmonic, else a shift of all [rad]
  frequency,     ///< of the excitation, if all harmonics have one [rad/s], else a factor on all
  position,      ///< x_c of a beam's contact [m]
  clock_offset,  ///< recorded minus true event times [s]
};

struct Parameter {
  Quantity quantity = Quantity::restitution;
  int contact = -1;  ///< from 0; -1: all of them, or the machine as a whole
  std::string name;  ///< as people say it
  std::string unit;  ///< empty: a number without one, or a factor
  double nominal = 0.0;
  /// Values that may be tried: physically possible, and no further from the nominal one than a
  /// mistake would be.
  double lowest = 0.0, highest = 0.0;
  bool cyclic = false;   ///< lowest and highest are the same machine
  bool relative = true;  ///< a change is worth saying in percent of the nominal value
};

/// Those that the scene's machine has: no damping where C = 0 on a general system, nothing of an
/// excitation where there is none. The clock's offset is one only if harmonics of different
/// frequencies tell it from a phase. `length` > 0 [m]: the machine's largest displacement, which
/// bounds the clearances.
std::vector<Parameter> parameters_of(const Scene& scene, double length);

/// The scene's machine with this value of the parameter, all else as it is.
Model with(const Scene& scene, const Parameter& parameter, double value);

/// The frequency [rad per unit of time] if all harmonics that move have the same, else 0.
double only_frequency(const Model& model);

}  // namespace sprag
