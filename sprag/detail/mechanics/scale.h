// What a machine itself says of the size of its numbers, whatever units they are in.
#pragma once

#include <cmath>

#include "sprag/model.h"

namespace sprag {

/// The power of two next above |x|, x not zero. Numbers divided by it keep their digits and lose
/// their unit, as far as that is a power of two: square roots of what is left are the same in all
/// such units.
inline double power_of_two_above(double x) {
  int exponent = 0;
  std::frexp(x, &exponent);
  return std::ldexp(1.0, exponent);
}

/// Time in which a machine that starts at `start` does something of note: ten periods of its
/// fastest vibration, decay or excitation, or the time in which the slowest of its contacts would
/// close under the forces at the start, whichever is less. Infinity where nothing moves. M must be
/// positive definite.
double time_scale(const Model& model, const State& start);

/// The longest of the coordinates of a start, the clearances and the amplitudes of supports; 1, in
/// the scene's unit, where all are 0.
double length_scale(const Model& model, const State& start);

/// An energy that the machine's motion may have, by what is known without running it: that of
/// `start`, of what its forces deflect it by, at a resonance as if 1 % of critical damping were the
/// least, of what moves with its supports, and of the way to them. 0 where all of this is.
double energy_scale(const Model& model, const State& start);

/// Makes the model's chatter_time 1e-8 time_scale(); where nothing moves nothing chatters, and it
/// stays.
void set_chatter_time(Model& model, const State& start);

}  // namespace sprag
