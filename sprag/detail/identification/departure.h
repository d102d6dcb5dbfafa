// How far a machine departs from its model, beside the jitter of its event times. Three kinds are
// distinguished, each by its gain of the restricted likelihood (linearized_filter.h): a *drift*,
// the process noise that the timing filter takes; a *scatter of the restitution* from impact to
// impact; and a *trend of the restitution* with the impact's speed.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

struct Identification;

/// A gain above this, twice the rise of ln L, is significant: chi^2 with one degree of freedom
/// where there is no error of the kind.
inline constexpr double significant_departure = 9.0;

struct DriftEstimate {
  double drift = 0.0;   ///< energy per unit of time, the most likely
  double jitter = 0.0;  ///< with it [s]
  /// Where ln L is lower by 1.92: 95 % are between. `low` is 0 where no drift is as likely.
  double low = 0.0, high = 0.0;
  double gain = 0.0;
  /// Of the unknowns with it, in coordinates: changes from the fit and standard deviations.
  Eigen::VectorXd changes, sigmas;

  bool found() const { return gain > significant_departure; }
};

struct RestitutionScatter {
  double scatter = 0.0;  ///< standard deviation of the restitution of one impact, the most likely
  double jitter = 0.0;   ///< with it [s]
  double gain = 0.0;
  Eigen::VectorXd changes, sigmas;  ///< as of a drift
  /// Ljung and Box's statistic Q of the innovations with it, as (Q - L) / sqrt(2 L) for L lags.
  double correlation = 0.0;
  /// Mean square of the last fifth of the innovations over that of those before it.
  double growth = 1.0;

  /// A larger scatter is no scatter: another machine has its restitution.
  static constexpr double largest = 0.03;
  bool found() const { return gain > significant_departure && scatter < largest; }
};

struct RestitutionTrend {
  double trend = 0.0, sigma = 0.0;  ///< d epsilon / d |gamma-|, per unit of speed
  /// What is left in squares of the jitter, as specified or as the fit has it, without it and with
  /// it.
  double chi2_without = 0.0, chi2_with = 0.0;
  double gain = 0.0;

  bool found() const { return gain > significant_departure; }
};

struct Departure {
  std::optional<DriftEstimate> drift;  ///< none: the fit does not determine it
  std::optional<RestitutionScatter> scatter;
  std::optional<RestitutionTrend> trend;
  /// As RestitutionScatter::correlation, with the jitter alone.
  double correlation = 0.0;

  /// The kind that explains most, if it is significant.
  bool is_drift() const;
  bool is_scatter() const;
  bool is_trend() const;
  /// Whether the scatter of the times is neither white nor that of a scattering restitution.
  bool is_structured() const;
};

/// (Q - L) / sqrt(2 L) of Ljung and Box's test (1978), L = min(16, n / 4) lags, of n innovations
/// from number `first` on; about a standard normal variable where they are white.
double correlation_of(const std::vector<double>& innovations, std::size_t first);

/// Mean square of the last fifth of these innovations over that of the others from `first` on.
double growth_of(const std::vector<double>& innovations, std::size_t first);

/// Of a fit that has a minimum, whether it is believed or not. Of a restitution only where one was
/// sought.
Departure estimate_departure(const Scene& scene, const Identification& fit);

/// Takes a drift or scatter that was found into the deviations of the unknowns.
void include(const Departure& departure, Identification& fit);

}  // namespace sprag
