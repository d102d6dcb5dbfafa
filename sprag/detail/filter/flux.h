// An event happens where the flux through the support is. Of two states that both have a gap of
// zero at t, the one that approaches twice as fast is twice as likely to have its event within dt.
#pragma once

namespace sprag {

/// Probability that a standard normal variable is below x.
double normal_cdf(double x);

/// Of gamma ~ N(mu, d^2) where gamma < 0, weighted by -gamma + even: log of the total weight, mean
/// and variance.
struct FluxMoments {
  double log_weight, mean, variance;
};
/// \param d     > 0
/// \param even  >= 0, a weight that does not depend on gamma
FluxMoments flux_moments(double mu, double d, double even);

}  // namespace sprag
