// Deviations of a machine's events or parameters from what the observer assumes, and their range
// of amounts.
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
    spurious,  ///< spurious pulses of each contact, per unit of time
    parameter  ///< a parameter with a wrong value in the observer
  };

  Kind kind = Kind::jitter;
  std::string name;      ///< "jitter", ..., or a key of the scene file
  std::string unit;      ///< of an amount; empty: none
  bool share = false;    ///< amounts are shares
  double least = 0.0;    ///< least amount in the study
  double most = 0.0;     ///< largest amount in the study
  Unknown unknown = {};  ///< the parameter, for Kind::parameter
};

/// All deviations of events, and one for every parameter of the scene's machine.
std::vector<Deviation> deviations_of(const Scene& scene, double closings_per_time);

/// The amounts 1, 2 and 5 times 10^n from `least` to `most`; `coarse`: 10^n only.
std::vector<double> amounts(const Deviation& of, bool coarse);

/// The observer's scene with one parameter wrong by this amount, upwards or downwards
/// (`other_way`). If the parameter cannot deviate in that direction, the other one is used. Throws
/// ModelError.
Scene with_wrong_parameter(const Scene& scene, const Deviation& of, double amount, bool other_way);

}  // namespace sprag::tolerance
