// Event times of the last bounces of a chatter, which are closer together than the jitter. A path
// that is led through them at their measured times has impacts where its gaps are not zero. The
// state before these impacts then constrains the state after them too strongly or too weakly. This
// file treats them as impacts with unknown times, which the path determines.
#pragma once

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

/// Turns the passages (Passage) of `stretches` that are bounces into impacts with unknown times, in
/// `stretches` and in its solution `path`. Bounces with flights far below the jitter are left out.
/// The new impacts are where the path has them. Where the path has none, they remain passages.
void take_bounces(const MachineFamily& family, double jitter, Stretches& stretches,
                  Likelihood& path);

}  // namespace sprag
