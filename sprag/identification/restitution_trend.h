// Whether one restitution explains the impacts, or whether it depends on how fast they are:
//
//   epsilon = epsilon_0 + trend (|gamma-| - usual |gamma-|),
//
// the trend estimated to first order beside all that was fitted (linearized_filter.h).
#pragma once

#include <optional>

#include "sprag/identification/identification.h"

namespace sprag {

struct RestitutionTrend {
  double trend = 0.0, sigma = 0.0;  ///< d epsilon / d |gamma-|, per unit of speed
  /// What is left in squares of the jitter, as told or as the fit has it, without it and with it.
  double chi2_without = 0.0, chi2_with = 0.0;
  double gain = 0.0;  ///< twice the rise of ln L: chi^2 where there is none

  bool found() const { return gain > 9.0; }
};

/// Of a fit that sought a restitution. None where it did not, where times are exact, or where it
/// leaves so much that it may be to other values than the machine's.
std::optional<RestitutionTrend> estimate_restitution_trend(const Scene& scene,
                                                           const Identification& fit);

}  // namespace sprag
