#include "sprag/detail/tolerance/guaranteed.h"

#include <algorithm>
#include <cmath>

#include "sprag/certified_floor.h"
#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/energy.h"

namespace sprag::tolerance {
namespace {

constexpr int bisections = 12;        // in the logarithm of the amount
constexpr double least_share = 1e-4;  // of the least amount of the simulated runs

// The tolerance for an amount; empty if the bound does not cover this deviation.
std::optional<Tolerance> tolerance_of(const Scene& scene, const Deviation& deviation,
                                      double amount) {
  Tolerance tolerance;
  if (deviation.kind == Deviation::Kind::jitter) {
    tolerance.time = amount;
    return tolerance;
  }
  if (deviation.kind != Deviation::Kind::parameter) return std::nullopt;
  if (!deviation.share) {
    if (!(deviation.unknown.nominal > 0.0)) return std::nullopt;
    amount /= deviation.unknown.nominal;
  }
  switch (deviation.unknown.kind) {
    case Unknown::Kind::restitution:
      tolerance.restitution =
          std::min(amount * largest_restitution(scene.model), Tolerance::largest_restitution);
      return tolerance;
    case Unknown::Kind::stiffness:
      tolerance.stiffness = std::min(amount, Tolerance::largest_share);
      return tolerance;
    case Unknown::Kind::damping:
      tolerance.damping = std::min(amount, Tolerance::largest_share);
      return tolerance;
    default:
      return std::nullopt;
  }
}

}  // namespace

std::optional<Limit> guaranteed_limit(const Bench& bench, const Deviation& deviation) {
  Scene scene = bench.scene();
  if (!tolerance_of(scene, deviation, deviation.least)) return std::nullopt;
  if (scene.prior.uncertainty.size() == 0) {
    const double V = ErrorEnergy(scene.model)(scene.truth.start.q, scene.truth.start.u,
                                              scene.prior.start.q, scene.prior.start.u)[0];
    const Eigen::Index f = scene.model.coordinates();
    const double least = 1e-12 * bench.motion_energy();
    scene.prior.uncertainty =
        Eigen::VectorXd::Constant(f, std::max(V, least) / static_cast<double>(f));
  }
  if (!why_no_bound(scene).empty()) return std::nullopt;
  const auto holds = [&](double amount) {
    scene.prior.tolerance = *tolerance_of(scene, deviation, amount);
    return certified_floor(scene, bench.truth(0).events, bench.duration()).median < bench.target();
  };
  double low = least_share * deviation.least;
  double high = deviation.most;
  if (!holds(low)) return Limit{Limit::Kind::never, 0.0};
  if (holds(high)) return Limit{Limit::Kind::beyond_all, high};
  for (int i = 0; i < bisections; ++i) {
    const double middle = std::sqrt(low * high);
    (holds(middle) ? low : high) = middle;
  }
  return Limit{Limit::Kind::within, low};
}

}  // namespace sprag::tolerance
