#include "sprag/detail/identification/fitted_parameters.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// The standard deviation in the unit of the key in the written scene.
double sigma_in(const Scene& written, const FittedUnknown& of) {
  const Kind kind = of.unknown.kind;
  const bool absolute = kind == Kind::phase || kind == Kind::clearance ||
                        kind == Kind::clock_offset || kind == Kind::delay;
  if (absolute || of.value == 0.0) return of.sigma;
  return of.sigma * std::abs(unknown_of(written, of.unknown.key).nominal / of.value);
}

bool is_considered(const ParameterUncertainty& before, const std::string& key) {
  const auto at = std::find(before.keys.begin(), before.keys.end(), key);
  return at != before.keys.end() &&
         before.consider[static_cast<std::size_t>(at - before.keys.begin())];
}

// Correlation of values, from the covariance of their coordinates.
Eigen::MatrixXd correlation_of(const Identification& fit, const std::vector<std::size_t>& numbers) {
  const auto n = std::ssize(numbers);
  const Eigen::MatrixXd& covariance = fit.likelihood.covariance;
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const auto a = static_cast<Eigen::Index>(numbers[static_cast<std::size_t>(i)]);
      const auto b = static_cast<Eigen::Index>(numbers[static_cast<std::size_t>(j)]);
      const double scale = std::sqrt(covariance(a, a) * covariance(b, b));
      if (!(scale > 0.0)) continue;
      const double of_pair = 0.5 * (covariance(a, b) + covariance(b, a)) / scale;
      correlation(i, j) = correlation(j, i) = std::clamp(of_pair, -1.0, 1.0);
    }
  }
  if (n == 0) return correlation;
  // Rounding may leave a negative eigenvalue.
  const double least = eigenvalues(correlation)[0];
  if (least < 0.0) {
    const double diagonal = 1.0 - 2.0 * least;
    correlation /= diagonal;
    correlation.diagonal().setOnes();
  }
  return correlation;
}

bool has_sigma(const FittedUnknown& of) {
  return of.determined && !of.at_bound && of.sigma > 0.0 && std::isfinite(of.sigma);
}

}  // namespace

ParameterUncertainty fitted_parameters(const Identification& fit,
                                       const ParameterUncertainty& before, const Scene& written) {
  ParameterUncertainty uncertainty;
  std::vector<std::size_t> numbers;
  std::vector<double> sigma;
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const FittedUnknown& of = fit.unknowns[k];
    if (!has_sigma(of) || !can_be_filtered(of.unknown)) continue;
    numbers.push_back(k);
    sigma.push_back(sigma_in(written, of));
    uncertainty.keys.push_back(of.unknown.key);
    uncertainty.consider.push_back(is_considered(before, of.unknown.key));
  }
  uncertainty.sigma = Eigen::Map<const Eigen::VectorXd>(sigma.data(), std::ssize(sigma));
  uncertainty.correlation = correlation_of(fit, numbers);
  return uncertainty;
}

std::vector<std::string> not_filtered(const Identification& fit) {
  std::vector<std::string> keys;
  for (const FittedUnknown& of : fit.unknowns) {
    if (has_sigma(of) && !can_be_filtered(of.unknown)) keys.push_back(of.unknown.key);
  }
  return keys;
}

}  // namespace sprag
