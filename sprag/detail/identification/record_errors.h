// Effect of errors of the recorded inputs on a fit. The events cannot reveal such an error: a fit
// may absorb it in its unknowns. So the fit is repeated with other records:
//
// * noise: draws of the samples' errors with their stated standard deviation;
// * resolution: the record with half of its sampling rate. For interpolation of order p the
//   difference of the two, over 2^p - 1, estimates the interpolation error (Richardson);
// * interpolation: the record with the other interpolation, unless the events rule it out.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/model.h"

namespace sprag {

/// The state (q, u) at the start of the first stretch.
State state_at_start(const MachineFamily& family, const Likelihood& solution);

/// `optimum` is the fit of `stretches` with the unknowns `held`; `sigma` is the standard deviation
/// of event times [s].
RecordErrors estimate_record_errors(const MachineFamily& family, const Stretches& stretches,
                                    const Likelihood& optimum, std::span<const std::size_t> held,
                                    double sigma);

}  // namespace sprag
