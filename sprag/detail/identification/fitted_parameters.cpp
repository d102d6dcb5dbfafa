#include "sprag/detail/identification/fitted_parameters.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

// The standard deviation in the unit of the key in the written scene.
double sigma_in(const Scene& written, const FittedUnknown& of) {
  if (!of.unknown.relative || of.value == 0.0) return of.sigma;
  return of.sigma * std::abs(parameter_of(written, of.unknown.key).nominal / of.value);
}

bool is_considered(const ParameterUncertainty& before, const std::string& key) {
  const auto at = std::find(before.keys.begin(), before.keys.end(), key);
  return at != before.keys.end() &&
         before.consider[static_cast<std::size_t>(at - before.keys.begin())];
}

// Of two parameters, from the covariance of their coordinates; nan without variance.
double correlation_of_pair(const Eigen::MatrixXd& covariance, Eigen::Index i, Eigen::Index j) {
  const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
  if (!(scale > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  if (i == j) return 1.0;
  return std::clamp(0.5 * (covariance(i, j) + covariance(j, i)) / scale, -1.0, 1.0);
}

Eigen::MatrixXd correlation_of(const Identification& fit, const std::vector<std::size_t>& numbers) {
  const auto n = std::ssize(numbers);
  const Eigen::MatrixXd& covariance = fit.covariance;
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const auto a = static_cast<Eigen::Index>(numbers[static_cast<std::size_t>(i)]);
      const auto b = static_cast<Eigen::Index>(numbers[static_cast<std::size_t>(j)]);
      const double of_pair = correlation_of_pair(covariance, a, b);
      if (std::isfinite(of_pair)) correlation(i, j) = correlation(j, i) = of_pair;
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

Eigen::MatrixXd correlations(const Identification& fit) {
  const Eigen::MatrixXd& covariance = fit.covariance;
  const auto P = std::ssize(fit.unknowns);
  const auto n = std::min(P, covariance.rows());
  Eigen::MatrixXd all = Eigen::MatrixXd::Constant(P, P, std::numeric_limits<double>::quiet_NaN());
  const auto determined = [&](Eigen::Index k) {
    return fit.unknowns[static_cast<std::size_t>(k)].determined;
  };
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      if (determined(i) && determined(j)) all(i, j) = correlation_of_pair(covariance, i, j);
    }
  }
  return all;
}

std::vector<std::string> not_filtered(const Identification& fit) {
  std::vector<std::string> keys;
  for (const FittedUnknown& of : fit.unknowns) {
    if (has_sigma(of) && !can_be_filtered(of.unknown)) keys.push_back(of.unknown.key);
  }
  return keys;
}

}  // namespace sprag
