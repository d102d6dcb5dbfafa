// Model mismatch of a machine, besides the jitter of its event times. Three kinds are
// distinguished, each by its gain of the restricted likelihood (linearized_filter.h): a *drift*,
// the process noise of the timing filter; a *scatter of the restitution* from impact to impact; and
// a *trend of the restitution* with the impact's speed.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

struct Identification;

/// A gain, twice the rise of ln L, above this is significant. Without an error of the kind it is
/// chi^2 distributed with one degree of freedom.
inline constexpr double significant_departure = 9.0;

struct DriftEstimate {
  double drift = 0.0;   ///< most likely drift, energy per unit of time
  double jitter = 0.0;  ///< most likely jitter with this drift [s]
  /// Ends of the 95 % interval, where ln L is lower by 1.92. `low` is 0 if no drift lies in the
  /// interval.
  double low = 0.0, high = 0.0;
  double gain = 0.0;
  /// With this drift, in the unknowns' coordinates: their changes from the fit and their standard
  /// deviations.
  Eigen::VectorXd changes, sigmas;

  bool found() const { return gain > significant_departure; }
};

struct RestitutionScatter {
  double scatter = 0.0;  ///< standard deviation of the restitution of one impact, the most likely
  double jitter = 0.0;   ///< most likely jitter with this scatter [s]
  double gain = 0.0;
  Eigen::VectorXd changes, sigmas;  ///< as DriftEstimate's
  /// Ljung and Box's statistic Q of the innovations with this scatter, as (Q - L) / sqrt(2 L) for L
  /// lags.
  double correlation = 0.0;
  /// Mean square of the last fifth of the innovations, over that of the earlier ones.
  double growth = 1.0;

  /// A larger estimate is no scatter of the machine's restitution: the model is another one.
  static constexpr double largest = 0.03;
  bool found() const { return gain > significant_departure && scatter < largest; }
};

struct RestitutionTrend {
  double trend = 0.0, sigma = 0.0;  ///< d epsilon / d |gamma-|, per unit of speed
  /// chi^2 of the residuals, in units of the specified or fitted jitter, without and with the
  /// trend.
  double chi2_without = 0.0, chi2_with = 0.0;
  double gain = 0.0;

  bool found() const { return gain > significant_departure; }
};

struct Departure {
  std::optional<DriftEstimate> drift;  ///< empty if the fit does not determine it
  std::optional<RestitutionScatter> scatter;
  std::optional<RestitutionTrend> trend;
  /// The trend beside a significant drift or scatter, which its deviation includes; else `trend`.
  std::optional<RestitutionTrend> trend_beside;
  /// As RestitutionScatter::correlation, without any scatter.
  double correlation = 0.0;

  /// True for the kind with the largest gain, if the gain is significant.
  bool is_drift() const;
  bool is_scatter() const;
  bool is_trend() const;
  /// Whether the residuals are neither white nor explained by a scattering restitution.
  bool is_structured() const;
};

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
