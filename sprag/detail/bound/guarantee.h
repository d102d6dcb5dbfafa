// Guaranteed statements about an estimate: the bound B and, in a scene with tolerances, half-widths
// of all shown quantities and whether the bound refutes the filter's estimate.
//
// The machine is within B of the replica. If the filter's band of 5 sigma about a coordinate,
// velocity or gap does not overlap the band of B about the replica's, the filter's claim is false.
// The replica is then shown until the bands overlap again.
#pragma once

#include <cstdint>
#include <memory>

#include "sprag/confidence.h"
#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/half_width.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/scene.h"

namespace sprag {

/// Error in standard deviations beyond which a filter's claim counts as false.
inline constexpr double claimed_sigmas = 5.0;

/// Whether |difference_i| > factor_i sqrt(bound) + 5 sigma_i for some i: the estimate and its sigma
/// contradict the bound about the replica. Ignores entries whose sigma is not finite.
/// \param difference estimate less replica, \param factors half-widths per sqrt of energy
bool contradicts(const Eigen::VectorXd& difference, const Eigen::VectorXd& sigma,
                 const Eigen::VectorXd& factors, double bound);

class Guarantee {
 public:
  /// For an estimator with a replica on these flows, which must outlive this; h is its tick. Throws
  /// ModelError.
  Guarantee(const Scene& scene, Flows& flows, double h);

  /// Delay of settled ticks [s]: a tick needs every event up to this much later.
  double lag() const { return tracker_.tolerance().time; }
  /// No estimate after t will be requested: the last ticks of the time line settle without delay.
  template <typename Line>
  void set_end(double t, Line& line) {
    line.set_lag(lag(), last_tick(t, line.h()));
    tracker_.set_end(t);
  }

  /// Makes room for half-widths in a scene with tolerances whose bound can be finite.
  void prepare(Confidence& confidence) const;

  /// Takes the events up to a settled tick at t; ticks in order.
  template <typename Line>
  void follow(const Line& line, double t) {
    tracker_.follow(line, t);
  }

  /// Completes `confidence`, which the estimator has filled in, for the estimate (q, u) at t, f
  /// entries each; calls follow() for a settled tick. (q_replica, u_replica) is the replica's
  /// state. If the filter's estimate is refuted, (q, u) become the replica's. Does not allocate.
  template <typename Line>
  void complete(const Line& line, double t, bool settled, const Eigen::VectorXd& q_replica,
                const Eigen::VectorXd& u_replica, Eigen::VectorXd& q, Eigen::VectorXd& u,
                Confidence& confidence) {
    if (settled) follow(line, t);
    confidence.bound = settled ? tracker_.bound(line, t, q_replica, u_replica) : infinity;
    if (!tracker_.tolerance().any()) return;
    if (starts_ != line.starts()) {
      starts_ = line.starts();
      refuted_ = false;
    }
    check(settled, q_replica, u_replica, q, u, confidence);
    set_widths(q_replica, u_replica, q, u, confidence);
  }
  /// The same with the replica in the estimator's state.
  template <typename Line, typename Estimator>
  void complete(const Line& line, double t, bool settled, const Estimator& estimator,
                const typename Estimator::State& state, Eigen::VectorXd& q, Eigen::VectorXd& u,
                Confidence& confidence) {
    estimator.replica(state, q_replica_, u_replica_);
    complete(line, t, settled, q_replica_, u_replica_, q, u, confidence);
  }

 private:
  const Dynamics& dynamics() const { return tracker_.metric().dynamics(); }
  void check(bool settled, const Eigen::VectorXd& q_replica, const Eigen::VectorXd& u_replica,
             Eigen::VectorXd& q, Eigen::VectorXd& u, Confidence& confidence);
  void set_widths(const Eigen::VectorXd& q_replica, const Eigen::VectorXd& u_replica,
                  const Eigen::VectorXd& q, const Eigen::VectorXd& u, Confidence& confidence);

  BoundTracker tracker_;
  HalfWidths widths_;
  bool has_widths_;
  bool refuted_ = false;          // the filter's estimate was refuted at the last check
  std::int64_t refutations_ = 0;  // number of times refuted_ was set
  std::int64_t starts_ = 0;
  Eigen::VectorXd dq_, du_, dg_, q_replica_, u_replica_;  // scratch
};

/// B(0): the sum of the scene's `uncertainty`. Infinite without one. Infinite also without
/// tolerances where anything but the start is uncertain: event times, parameters or inputs.
double initial_bound(const Scene& scene);

/// Guarantee for a scene's estimator, which must outlive it; null if the scene has neither
/// tolerances nor a finite initial_bound(), or the estimator has no replica. Throws ModelError.
template <typename Estimator>
std::unique_ptr<Guarantee> guarantee_of(const Scene& scene, Estimator& estimator) {
  if (!estimator.has_replica()) return nullptr;
  if (!scene.prior.tolerance.any() && initial_bound(scene) == infinity) return nullptr;
  return std::make_unique<Guarantee>(scene, estimator.flows(), estimator.h());
}

}  // namespace sprag
