#include "sprag/detail/bound/certified_floor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/dissipation_cap.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/observer.h"

namespace sprag {
namespace {

constexpr double floor_samples = 2000.0;

}  // namespace

CertifiedFloor certified_floor(const Scene& scene, std::span<const ContactEvent> events,
                               double duration) {
  const ObserverSettings settings{.tick = duration / floor_samples,
                                  .estimator = EstimatorKind::replica};
  const Estimates all = observe(scene, events, duration, settings);
  std::vector<double> late;
  for (Eigen::Index k = all.bound.size() / 2; k < all.bound.size(); ++k) {
    if (std::isfinite(all.bound[k])) late.push_back(all.bound[k]);
  }
  CertifiedFloor floor{infinity, infinity, infinity};
  if (!late.empty()) {
    std::sort(late.begin(), late.end());
    floor.median = late[late.size() / 2];
    floor.largest = late.back();
  }
  Scene unknown_start = scene;
  unknown_start.prior.uncertainty.resize(0);
  if (!why_no_bound(unknown_start).empty()) return floor;
  // Largest over all states on the replica's path.
  const Dynamics dynamics(scene.model);
  const EnergyMetric metric(dynamics);
  const DissipationCap cap(metric, scene.prior.tolerance);
  floor.without_events = 0.0;
  ModalState state;
  for (Eigen::Index k = 0; k < all.t.size(); ++k) {
    metric.enter(all.q.row(k).transpose(), all.u.row(k).transpose(), state);
    const double b = cap.distance(cap.ultimate(), state, all.t[k]);
    floor.without_events = std::max(floor.without_events, square(b));
  }
  return floor;
}

}  // namespace sprag
