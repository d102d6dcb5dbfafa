// The last bounces of a chatter come sooner after each other than their times are known. A path
// that is led through them at the measured times rebounds where no support is, and what is known
// of the state before them it takes for more, or less, than is known behind them. They are impacts
// like all others, but for their times, which the path has to tell.
#pragma once

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// Takes the bounces of `stretches` that are passed (Passage) for impacts of unknown time, down to
/// flights that are far below the jitter, in `stretches` and in `path`, which begins with them.
/// They are where that path has them, and stay passed where it has none.
void take_bounces(const MachineFamily& family, double jitter, Stretches& stretches,
                  Likelihood& path);

}  // namespace sprag
