// Events that were lost, and events that never were: from impacts in a row that fit, the machine's
// path is followed forward to the last event and, each impact undone, backward to the first. An
// event that comes where it expects none is spurious; an impact that it expects and that has no
// event was lost, and gets the expected time, as a guess.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

struct Mended {
  Likelihood solution;
  Stretches stretches;                ///< those of the solution, with the measured times
  std::vector<std::size_t> spurious;  ///< numbers of events
  std::vector<Impact> missing;        ///< with the times of the solution
};

/// Leaves out stamps that are farther from the solution than their jitter makes them, one after the
/// other, the worst first: their impacts stay, without a time.
void drop_outliers(const MachineFamily& family, double jitter, Mended& mended);

/// Repairs the events of one stretch. `interval` is the usual time between impacts; without a
/// jitter it is what the first impacts that fit have. Offers each repair to `is_solution`, which
/// keeps what it takes; returns whether it took one.
bool mend(const MachineFamily& family, const Stretch& record, std::optional<double> jitter,
          double interval, const std::function<bool(const Mended&)>& is_solution);

}  // namespace sprag
