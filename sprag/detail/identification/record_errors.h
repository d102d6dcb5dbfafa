// Effect of errors of the recorded inputs on a fit. The events cannot reveal such an error: a fit
// may absorb it in its unknowns. So the fit is moved, to first order, to other records:
//
// * noise: draws of the samples' errors with their stated standard deviation;
// * resolution: the record with half of its sampling rate. For interpolation of order p the
//   difference of the two, over 2^p - 1, estimates the interpolation error (Richardson);
// * interpolation: the record with the other interpolation, unless the events rule it out.
#pragma once

#include <vector>

#include "sprag/detail/identification/gauss_newton.h"
#include "sprag/identification.h"

namespace sprag {

/// The state (q, u) at the first start of a fit.
State state_at_start(FamilyFlight& flight, const EventFit& fit);

/// `sigma`: standard deviation of event times [s].
RecordErrors estimate_record_errors(const Scene& scene, const std::vector<Parameter>& unknowns,
                                    bool strictly_within, const EventFit& optimum, double sigma);

}  // namespace sprag
