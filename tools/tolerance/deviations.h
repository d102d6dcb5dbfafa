// What may be off about a machine's events or its parameters, how far it is tried, and in which
// words an amount of it is said.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag::tolerance {

struct Deviation {
  enum class Kind {
    jitter,    ///< standard deviation of event times
    offset,    ///< of all event times
    lost,      ///< share of events that never arrive
    spurious,  ///< pulses that were none, of each contact, per unit of time
    parameter  ///< a parameter of the machine that the observer has wrong
  };

  Kind kind = Kind::jitter;
  std::string name;      ///< "jitter", ..., or the key of the scene file
  std::string unit;      ///< of an amount; empty: none
  bool share = false;    ///< amounts are shares
  double least = 0.0;    ///< amount that is tried
  double most = 0.0;     ///< likewise
  Unknown unknown = {};  ///< of a parameter
};

/// Of the events, and every parameter that the scene's machine has.
std::vector<Deviation> deviations_of(const Scene& scene, double closings_per_time);

/// The amounts 1, 2 and 5 times 10^n from the least to the most one; `coarse`: 10^n alone.
std::vector<double> amounts(const Deviation& of, bool coarse);

/// The machine as an observer takes it to be which has a parameter wrong by this amount, one way or
/// the other; where it cannot be off that way, the one that it can. Throws ModelError.
Scene with_wrong_parameter(const Scene& scene, const Deviation& of, double amount, bool other_way);

/// "0.3 ms", "5 %", "0.02 rad", "0.1 per s and contact".
std::string amount_text(const Deviation& of, double amount);

/// "event times to 0.3 ms", "2 % of the events lost", "impact.restitution to 5 %".
std::string in_words(const Deviation& of, double amount);

}  // namespace sprag::tolerance
