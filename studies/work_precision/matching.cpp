#include "studies/work_precision/matching.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sprag::work_precision {
namespace {

constexpr double least_impact = 1e-4;      // [m/s]
constexpr double widest_window = 0.05;     // [s]
constexpr double chatter_radius = 0.02;    // [s]
constexpr double impact_at_sample = 1e-3;  // [s]
constexpr double lost = 1e-2;              // error of q

double distance(std::span<const ReferenceImpact> reference, double t) {
  const auto next =
      std::lower_bound(reference.begin(), reference.end(), t,
                       [](const ReferenceImpact& impact, double time) { return impact.t < time; });
  double nearest = std::numeric_limits<double>::infinity();
  if (next != reference.end()) nearest = next->t - t;
  if (next != reference.begin()) nearest = std::min(nearest, t - std::prev(next)->t);
  return nearest;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*middle + *std::max_element(values.begin(), middle)) / 2;
}

}  // namespace

ImpactScore score(std::span<const ReferenceImpact> reference, std::span<const double> impacts,
                  double horizon) {
  const auto beyond =
      std::upper_bound(reference.begin(), reference.end(), horizon,
                       [](double t, const ReferenceImpact& impact) { return t < impact.t; });
  reference = reference.first(static_cast<std::size_t>(beyond - reference.begin()));
  std::vector<double> times;
  for (const double t : impacts) {
    if (t <= horizon) times.push_back(t);
  }
  std::sort(times.begin(), times.end());
  std::vector<bool> matched(times.size(), false);

  ImpactScore result;
  std::vector<double> errors;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const double t = reference[i].t;
    if (!(std::abs(reference[i].gamma_minus) > least_impact)) continue;
    double before = widest_window;
    double after = widest_window;
    if (i > 0) before = std::min(before, (t - reference[i - 1].t) / 2);
    if (i + 1 < reference.size()) after = std::min(after, (reference[i + 1].t - t) / 2);
    auto best = times.size();
    auto j = static_cast<std::size_t>(std::lower_bound(times.begin(), times.end(), t - before) -
                                      times.begin());
    for (; j < times.size() && times[j] <= t + after; ++j) {
      const bool nearer =
          best == times.size() || std::abs(times[j] - t) < std::abs(times[best] - t);
      if (!matched[j] && nearer) best = j;
    }
    if (best == times.size()) {
      if (result.missed++ == 0) result.first_missed = t;
      continue;
    }
    matched[best] = true;
    ++result.found;
    errors.push_back(std::abs(times[best] - t));
  }
  for (std::size_t j = 0; j < times.size(); ++j) {
    if (!matched[j] && distance(reference, times[j]) > chatter_radius) ++result.invented;
  }
  if (!errors.empty()) {
    result.max_dt = *std::max_element(errors.begin(), errors.end());
    result.median_dt = median(std::move(errors));
  }
  return result;
}

StateScore score(const Reference& reference, const Eigen::MatrixXd& q, const Eigen::MatrixXd& u,
                 double until) {
  StateScore result;
  result.horizon = until;
  double sum = 0.0;
  double largest = 0.0;
  int states = 0;
  int velocities = 0;
  bool ended = false;
  for (Eigen::Index k = 0; k < reference.q.cols(); ++k) {
    const double t = static_cast<double>(k) * reference.sample_step;
    if (t > until) break;
    const bool reached = k < q.cols() && q.col(k).allFinite() && u.col(k).allFinite();
    const double error =
        reached ? (q.col(k) - reference.q.col(k)).lpNorm<Eigen::Infinity>() : not_known;
    if (!ended && !(error <= lost)) {
      result.horizon = t;
      ended = true;
    }
    if (!reached) continue;
    largest = std::max(largest, error);
    ++states;
    if (distance(reference.impacts, t) < impact_at_sample) continue;
    sum += (u.col(k) - reference.u.col(k)).lpNorm<1>();
    ++velocities;
  }
  if (states > 0) result.sup_q = largest;
  if (velocities > 0) result.l1_u = sum / velocities;
  return result;
}

double penetration(const Task& task, const Eigen::MatrixXd& q) {
  double deepest = 0.0;
  bool reached = false;
  for (Eigen::Index k = 0; k < q.cols(); ++k) {
    if (!q.col(k).allFinite()) continue;
    reached = true;
    for (const Contact& contact : task.model.contacts) {
      deepest = std::max(deepest, -gap(contact, q.col(k), task.sample_time(k)));
    }
  }
  return reached ? deepest : not_known;
}

}  // namespace sprag::work_precision
