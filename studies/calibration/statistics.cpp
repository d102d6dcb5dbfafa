#include "studies/calibration/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/analysis/quantile.h"

namespace sprag::calibration {
namespace {

constexpr double far = 3.0;
constexpr double small_omega_sigma = 0.1;

double share(double part, std::int64_t all) {
  return all > 0 ? part / static_cast<double>(all) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

void NormalizedErrors::add(double error, double deviation) {
  if (std::isfinite(error) && std::isinf(deviation)) {
    ++unknown_;
    return;
  }
  const double z = error == 0.0 ? 0.0 : error / deviation;
  if (!std::isfinite(error) || std::isnan(z)) {
    ++not_numbers_;
    return;
  }
  ++count_;
  sum_ += z * z;
  if (std::abs(z) > far) ++beyond_;
}

void NormalizedErrors::add(const NormalizedErrors& others) {
  count_ += others.count_;
  unknown_ += others.unknown_;
  not_numbers_ += others.not_numbers_;
  beyond_ += others.beyond_;
  sum_ += others.sum_;
}

double NormalizedErrors::mean_square() const { return share(sum_, count_); }

double NormalizedErrors::beyond() const { return share(static_cast<double>(beyond_), count_); }

Summary summarize(std::span<const Trial> trials) {
  Summary all;
  const auto n = static_cast<double>(trials.size());
  double innovations = 0.0;
  std::int64_t innovation_count = 0;
  std::vector<double> V, V_replica, squares;
  for (const Trial& one : trials) {
    all.state.add(one.state);
    all.gaps.add(one.gaps);
    V.push_back(one.V);
    V_replica.push_back(one.V_replica);
    all.V_largest = std::max(all.V_largest, one.V_largest);
    all.V_replica_largest = std::max(all.V_replica_largest, one.V_replica_largest);
    innovations += one.innovations;
    innovation_count += one.innovation_count;
    all.inconsistencies += one.inconsistencies;
    all.from_filter += one.from_filter / n;
    all.worse += one.worse / n;
    all.worse_largest = std::max(all.worse_largest, one.worse);
    if (one.state.count() > 0) squares.push_back(one.state.mean_square());
  }
  all.V = quantile(V, 0.5);
  all.V_replica = quantile(V_replica, 0.5);
  all.J = share(innovations, innovation_count);
  const auto count = static_cast<double>(squares.size());
  double mean = 0.0;
  for (const double one : squares) mean += one / count;
  double variance = 0.0;
  for (const double one : squares) variance += (one - mean) * (one - mean) / (count * (count - 1));
  all.deviation = std::sqrt(variance);
  return all;
}

std::vector<std::string> missed_bars(const Summary& summary, double omega_sigma) {
  const bool slow = omega_sigma < small_omega_sigma;
  const auto within = [](double value, double low, double high) {
    return value >= low && value <= high;
  };
  std::vector<std::string> missed;
  const double z2 = summary.state.mean_square();
  if (!within(z2, slow ? 0.9 : 0.25, slow ? 1.1 : 1.35)) missed.emplace_back("z2");
  if (!(summary.state.beyond() <= (slow ? 0.005 : 0.012))) missed.emplace_back("3s");
  if (!within(summary.J, 0.5, 1.4)) missed.emplace_back("J");
  if (omega_sigma > 0.0) {
    if (!(summary.V <= 0.6 * summary.V_replica)) missed.emplace_back("V");
    if (!(summary.V_largest <= 2.0 * summary.V_replica_largest)) missed.emplace_back("Vmax");
  }
  if (summary.state.not_numbers() + summary.gaps.not_numbers() > 0) missed.emplace_back("nan");
  return missed;
}

}  // namespace sprag::calibration
