// Parameters of a scene's machine that may be wrong, one at a time, and the machine with another
// value of one: M u' + C u + K q = W lambda + f(t), g_i = w_i^T q + s_i(t) + c_i, and epsilon_i. A
// parameter that is one number in the scene keeps its unit. A parameter for several different
// numbers (restitutions, harmonics) or for a matrix (C, K of a general system) is a common factor,
// nominally 1; for phases it is a common shift, nominally 0.
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
  clock_offset,  ///< reading of the contact clock at the machine's t = 0 [s]
  clock_rate,    ///< of the contact clock [-]
  gain,          ///< of a recorded input [-]
  delay,         ///< of a recorded input [s]
};

struct Parameter {
  Quantity quantity = Quantity::restitution;
  int contact = -1;  ///< from 0; -1: all contacts, or the whole machine
  int record = -1;   ///< from 0: the recorded input of a gain or delay; -1: none
  std::string name;  ///< name for people
  std::string unit;  ///< empty: none, or a factor
  double nominal = 0.0;
  /// Range of values to try: physically possible and plausible as an error of the nominal value.
  double lowest = 0.0, highest = 0.0;
  bool cyclic = false;   ///< lowest and highest are the same machine
  bool relative = true;  ///< changes are reported in percent of the nominal value
};

/// Parameters of the scene's machine. A general system with C = 0 has no damping parameter, and a
/// machine without excitation none of an excitation. The clock's offset is included only if
/// harmonics of different frequencies distinguish it from a phase, and no record's delay does.
/// `length` > 0 [m]: the machine's largest displacement, which sets the range of clearances.
std::vector<Parameter> parameters_of(const Scene& scene, double length);

/// The rate of the contact clock.
Parameter clock_rate_of(const Scene& scene);

/// The scene's machine with this value of the parameter. With another offset or rate of the contact
/// clock: the same machine in the time of the events by the scene's clock.
Model with(const Scene& scene, const Parameter& parameter, double value);

/// Common frequency [rad per unit of time] of all harmonics with an amplitude; 0: they differ.
double only_frequency(const Model& model);

}  // namespace sprag
