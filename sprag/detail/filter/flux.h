// Moments of a gap velocity that is weighted by its flux through the support. Of two states with
// zero gap at t, the one that approaches twice as fast is twice as likely to have its event within
// dt.
#pragma once

namespace sprag {

/// Probability that a standard normal variable is below x.
double normal_cdf(double x);

/// gamma ~ N(mu, d^2), restricted to gamma < 0 and weighted by -gamma + even: log of the total
/// weight, mean and variance.
struct FluxMoments {
  double log_weight, mean, variance;
};
/// \param d     > 0
/// \param even  >= 0, the part of the weight that does not depend on gamma
FluxMoments flux_moments(double mu, double d, double even);

}  // namespace sprag
