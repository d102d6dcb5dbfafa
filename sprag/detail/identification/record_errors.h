// Effect of errors of the recorded inputs on a fit. The events cannot reveal such an error: a fit
// may absorb it in its unknowns. So the fit is repeated with other records:
//
// * noise: draws of the samples' errors with their stated standard deviation;
// * resolution: the record with half of its sampling rate. For interpolation of order p the
//   difference of the two, over 2^p - 1, estimates the interpolation error (Richardson);
// * interpolation: the record with the other interpolation, unless the events rule it out.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <span>
#include <vector>

#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/model.h"

namespace sprag {

/// Standard deviations by errors of the records; in the unknowns' coordinates, P entries, empty
/// without a record.
struct RecordErrors {
  Eigen::VectorXd noise;       ///< by the stated noise of the samples
  Eigen::VectorXd resolution;  ///< by the interpolation between samples
  State start;                 ///< of the state at the first stretch's start, by both
  /// Scatter of the event times that these errors cause [s].
  double noise_scatter = 0.0, resolution_scatter = 0.0;
  /// Scatter with the other interpolation, if that is far smaller than the fit's; else 0 [s].
  double other_scatter = 0.0;

  bool empty() const { return resolution.size() == 0; }
  /// The larger one of both scatters [s].
  double scatter() const { return std::max(noise_scatter, resolution_scatter); }
  /// Whether they explain the scatter of a fit [s].
  bool explains(double of_fit) const { return scatter() > 0.3 * of_fit; }
  /// Of unknown k, by both.
  double of(std::size_t k) const;
};

/// The state (q, u) at the start of the first stretch.
State state_at_start(const MachineFamily& family, const Likelihood& solution);

/// `optimum` is the fit of `stretches` with the unknowns `held`; `sigma` is the standard deviation
/// of event times [s].
RecordErrors estimate_record_errors(const MachineFamily& family, const Stretches& stretches,
                                    const Likelihood& optimum, std::span<const std::size_t> held,
                                    double sigma);

}  // namespace sprag
