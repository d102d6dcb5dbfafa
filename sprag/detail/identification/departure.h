// Model mismatch of a machine, besides the jitter of its event times. Three kinds are
// distinguished, each by its gain of the restricted likelihood (linearized_filter.h): a *drift*,
// the process noise of the timing filter; a *scatter of the restitution* from impact to impact; and
// a *trend of the restitution* with the impact's speed.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

/// (Q - L) / sqrt(2 L) of the test of Ljung & Box (1978) with L = min(16, n / 4) lags, for the n
/// innovations from number `first` on. About standard normal if they are white.
double correlation_of(const std::vector<double>& innovations, std::size_t first);

/// Mean square of the last fifth of these innovations, over that of the others from `first` on.
double growth_of(const std::vector<double>& innovations, std::size_t first);

/// Estimates the departures of a fit that has a minimum, accepted or not. Those of a restitution
/// only if the restitution was sought.
Departure estimate_departure(const Scene& scene, const Identification& fit);

/// Includes a significant drift or scatter in the standard deviations of the unknowns.
void include(const Departure& departure, Identification& fit);

}  // namespace sprag
