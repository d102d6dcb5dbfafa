// Repair of lost and spurious events. From consecutive impacts that fit, the machine's path is
// followed forward to the last event and backward, with each impact inverted, to the first. An
// event without an impact of the path is spurious. An impact without an event was lost and gets the
// path's time as a guess.
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
  Stretches stretches;                ///< stretches of the solution, with the measured times
  std::vector<std::size_t> spurious;  ///< numbers of spurious events
  std::vector<Impact> missing;        ///< lost impacts, with the times of the solution
};

/// Removes time stamps that are outliers by the jitter, one after the other, the worst first. Their
/// impacts stay, without a time.
void drop_outliers(const MachineFamily& family, double jitter, Mended& mended);

/// Repairs the events of one stretch. `interval` is the usual time between impacts. Without
/// `jitter` the scatter of the first impacts that fit is used. Each repair is offered to
/// `is_solution`, which stores an accepted one. Returns whether one was accepted.
bool mend(const MachineFamily& family, const Stretch& record, std::optional<double> jitter,
          double interval, const std::function<bool(const Mended&)>& is_solution);

}  // namespace sprag
