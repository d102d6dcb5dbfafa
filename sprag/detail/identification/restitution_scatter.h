// Whether the restitution scatters from impact to impact, as that of a ball on a rough floor:
//
//   epsilon_k ~ N(epsilon, scatter^2),
//
// scatter and, where it is not specified, jitter maximize the restricted likelihood of
// linearized_filter.h.
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Of a fit that sought a restitution. None where it did not, where times are exact, or where it
/// leaves so much that it may be to other values than the machine's.
std::optional<RestitutionScatter> estimate_restitution_scatter(const Scene& scene,
                                                               const Identification& fit);

}  // namespace sprag
