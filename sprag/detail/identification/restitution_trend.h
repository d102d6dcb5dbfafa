// Whether one restitution explains the impacts, or whether it depends on how fast they are:
//
//   epsilon = epsilon_0 + trend (|gamma-| - usual |gamma-|),
//
// the trend estimated to first order beside all that was fitted (linearized_filter.h).
#pragma once

#include <optional>

#include "sprag/identification.h"

namespace sprag {

/// Of a fit that sought a restitution. None where it did not, where times are exact, or where it
/// leaves so much that it may be to other values than the machine's.
std::optional<RestitutionTrend> estimate_restitution_trend(const Scene& scene,
                                                           const Identification& fit);

}  // namespace sprag
