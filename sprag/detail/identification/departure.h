// Departures of a machine from its model, besides the jitter of its event times: the causes of
// sprag/identification.h. To first order about a fit, most are one more unknown each, which gains
// twice the rise of ln L. A drift is the process noise of the timing filter, a scatter of the
// restitution a noise of each impact; these gain by the restricted likelihood.
#pragma once

#include <vector>

#include "sprag/detail/identification/gauss_newton.h"
#include "sprag/identification.h"

namespace sprag {

/// What the departures of a fit are judged by.
struct DepartureScale {
  double jitter = 0.0;  ///< standard deviation of the times: as given, or the fit's scatter [s]
  bool given = false;
  double interval = 0.0;  ///< usual time between events [s]
};

/// Estimates the departures of a fit, accepted or not. Those of a restitution only if the
/// restitution was sought.
Departure estimate_departure(const Scene& scene, const std::vector<Parameter>& unknowns,
                             GaussNewton& solver, const EventFit& fit, const DepartureScale& scale);

/// Includes a likely drift or scatter in the standard deviations of the unknowns.
void include(const Departure& departure, Identification& result);

}  // namespace sprag
