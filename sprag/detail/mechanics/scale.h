// Scales of time, length and energy of a machine, derived from the machine, in any system of units.
#pragma once

#include <cmath>

#include "sprag/model.h"

namespace sprag {

/// The power of two next above |x|, x not zero. Numbers divided by it keep their digits. Square
/// roots of the quotients are the same in all units that differ by a power of two.
inline double power_of_two_above(double x) {
  int exponent = 0;
  std::frexp(x, &exponent);
  return std::ldexp(1.0, exponent);
}

/// Typical time of a machine that starts at `start`: the lesser of about ten periods of its fastest
/// vibration, decay or excitation, and the time in which the slowest of its contacts would close
/// under the forces at the start. Infinity if nothing moves. M must be positive definite.
double time_scale(const Model& model, const State& start);

/// The largest of the start's coordinates, the clearances and the amplitudes of supports; 1, in the
/// scene's unit, if all of them are 0.
double length_scale(const Model& model, const State& start);

/// Estimate of the energy of the machine's motion, without a simulation. It is the sum of the
/// energies of `start`, of the response to the forces (with at least 1 % of critical damping), of
/// the masses that move with the supports, and of the deflections that close the clearances. 0 if
/// all of these are 0.
double energy_scale(const Model& model, const State& start);

/// Sets the model's chatter_time to 1e-8 time_scale(). If nothing moves, it stays unchanged.
void set_chatter_time(Model& model, const State& start);

}  // namespace sprag
