#include "sprag/detail/analysis/filter_trial.h"

#include <algorithm>
#include <vector>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/observer.h"

namespace sprag {
namespace {

constexpr int ticks = 400;
constexpr double few = 0.05;  // fraction of ticks that may exceed known_share, next to events

double largest_of_start(const Estimate& of, const Estimate& start) {
  return std::max(of.sigma_q.cwiseQuotient(start.sigma_q).maxCoeff(),
                  of.sigma_u.cwiseQuotient(start.sigma_u).maxCoeff());
}

}  // namespace

FilterTrial try_filter(const Scene& scene, std::span<const ContactEvent> events, double duration,
                       const TrialLimits& limits) {
  FilterTrial trial;
  if (!(duration > 0.0) || events.empty()) return trial;
  const double h = duration / ticks;
  Scene exact = scene;
  exact.prior.parameters = {};
  Observer observer(exact, {.tick = h, .estimator = EstimatorKind::timing});
  for (const ContactEvent& event : events) observer.take(event);
  const Estimate start = observer.at(0.0);
  std::vector<double> shares;
  for (int k = 1; k <= ticks && !(limits.out_of_time && limits.out_of_time()); ++k) {
    observer.set_horizon(k == ticks ? duration : tick_instant(k, h).hi);
    for (const Estimate& estimate : observer.settle()) {
      shares.push_back(largest_of_start(estimate, start));
      trial.duration = estimate.t;
    }
  }
  if (shares.empty()) return trial;
  trial.closings = std::count_if(events.begin(), events.end(), [&](const ContactEvent& event) {
    return event.t <= trial.duration && event.kind != ContactEventKind::opens;
  });
  std::int64_t unknown = 0;  // ticks from k on with known_share exceeded
  for (std::int64_t k = std::ssize(shares) - 1; k >= 0; --k) {
    const bool known = shares[static_cast<std::size_t>(k)] < known_share;
    if (!known) ++unknown;
    const auto ticks_on = static_cast<double>(std::ssize(shares) - k);
    if (known && static_cast<double>(unknown) <= few * ticks_on) {
      trial.known_from = tick_instant(k, h).hi;
    }
  }
  const auto from = shares.begin() + std::ssize(shares) * 3 / 4;
  const auto middle = from + (shares.end() - from) / 2;
  std::nth_element(from, middle, shares.end());
  trial.left = *middle;
  return trial;
}

}  // namespace sprag
