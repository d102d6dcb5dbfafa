// What is guaranteed of an estimate, beside what its estimator says: the bound B under the scene's
// tolerances, half-widths of all that is shown, and whether a filter's estimate is false.
//
// The machine is within B of the replica. So an estimate of a filter whose band of 5 sigma about a
// coordinate, velocity or gap does not meet the band of B about the replica's is wrong: the replica
// is shown in its place until the two agree again.
#pragma once

#include <cstdint>
#include <memory>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/bound/half_width.h"
#include "sprag/detail/estimates/confidence.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/scene.h"

namespace sprag {

/// How many standard deviations a filter may be off before its claim is false.
inline constexpr double claimed_sigmas = 5.0;

/// Whether |difference_i| > factor_i sqrt(bound) + 5 sigma_i for some i: an estimate and its claim
/// contradict the bound about the replica. Entries whose sigma is not finite say nothing.
/// \param difference estimate less replica, \param factors half-widths per sqrt of energy
bool contradicts(const Eigen::VectorXd& difference, const Eigen::VectorXd& sigma,
                 const Eigen::VectorXd& factors, double bound);

class Guarantee {
 public:
  /// Of a scene with tolerances and an estimator with a replica on these flows, which must outlive
  /// this; h is its tick. Throws ModelError.
  Guarantee(const Scene& scene, Flows& flows, double h);

  /// By how much settled ticks have to wait for it [s].
  double lag() const { return tracker_.tolerance().time; }
  /// Nothing after t will be asked for: the last ticks of the time line do not wait.
  template <typename Line>
  void set_end(double t, Line& line) {
    line.set_lag(lag(), last_tick(t, line.h()));
    tracker_.set_end(t);
  }

  /// Makes room for half-widths, where the bound can be finite.
  void prepare(Confidence& confidence) const;

  /// Takes what happened up to a settled tick at t; each in order.
  template <typename Line>
  void follow(const Line& line, double t) {
    tracker_.follow(line, t);
  }

  /// What is guaranteed of an estimate (q, u) at t, f entries each; a settled tick is followed
  /// first. The replica's own is (q_replica, u_replica). `confidence` has what the estimator says.
  /// Where a filter's estimate is false, (q, u) become the replica's. Does not allocate.
  template <typename Line>
  void complete(const Line& line, double t, bool settled, const Eigen::VectorXd& q_replica,
                const Eigen::VectorXd& u_replica, Eigen::VectorXd& q, Eigen::VectorXd& u,
                Confidence& confidence) {
    if (settled) follow(line, t);
    if (starts_ != line.starts()) {
      starts_ = line.starts();
      refuted_ = false;
    }
    confidence.bound = settled ? tracker_.bound(line, t, q_replica, u_replica) : infinity;
    check(settled, q_replica, u_replica, q, u, confidence);
    set_widths(q_replica, u_replica, q, u, confidence);
  }
  /// The same with the replica of an estimator in this state.
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
  bool can_be_finite_;
  bool refuted_ = false;          // the filter's estimate was false when last looked at
  std::int64_t refutations_ = 0;  // how often it became so
  std::int64_t starts_ = 0;
  Eigen::VectorXd dq_, du_, dg_, q_replica_, u_replica_;  // scratch
};

/// The guarantee of a scene's estimator, which must outlive it; null where the scene has no
/// tolerances or the estimator no replica. Throws ModelError.
template <typename Estimator>
std::unique_ptr<Guarantee> guarantee_of(const Scene& scene, Estimator& estimator) {
  if (!scene.tolerance.any() || !estimator.has_replica()) return nullptr;
  return std::make_unique<Guarantee>(scene, *estimator.flows(), estimator.h());
}

}  // namespace sprag
