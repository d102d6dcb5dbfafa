// What is guaranteed of an estimate, beside what its estimator says: the bound B under the scene's
// tolerances, half-widths of all that is shown, and whether a filter's estimate is false.
//
// The machine is within B of the replica. So an estimate of a filter whose band of 5 sigma about a
// coordinate, velocity or gap does not meet the band of B about the replica's is wrong: the replica
// is shown in its place until the two agree again.
#pragma once

#include <memory>
#include <optional>

#include "sprag/bound/bound_tracker.h"
#include "sprag/bound/half_width.h"
#include "sprag/estimation/confidence.h"
#include "sprag/mechanics/scene.h"

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
  /// Of an estimator with a replica on these flows, which must outlive this; h is its tick. Throws
  /// ModelError.
  Guarantee(const Scene& scene, Flows& flows, double h);

  /// Whether the bound is that of the scene's tolerances, and not of an exact machine.
  bool tolerant() const { return tracker_.has_value(); }
  /// By how much settled ticks have to wait for it [s].
  double lag() const { return tracker_ ? tracker_->tolerance().time : 0.0; }
  /// Nothing after t will be asked for.
  void set_end(double t) {
    if (tracker_) tracker_->set_end(t);
  }

  /// Room for half-widths, where there are tolerances.
  void prepare(Confidence& confidence) const;

  /// Takes what happened up to a settled tick at t; each in order.
  template <typename Line>
  void follow(const Line& line, double t) {
    if (tracker_) tracker_->follow(line, t);
  }

  /// What is guaranteed of an estimate (q, u) at t, f entries each: `settled` of a settled tick,
  /// after follow(). The replica's own is (q_replica, u_replica). `confidence` has what the
  /// estimator says, and for an exact machine its bound. Where a filter's estimate is false, (q, u)
  /// become the replica's. Does not allocate.
  template <typename Line>
  void complete(const Line& line, double t, bool settled, const Eigen::VectorXd& q_replica,
                const Eigen::VectorXd& u_replica, Eigen::VectorXd& q, Eigen::VectorXd& u,
                Confidence& confidence) {
    if (tracker_) {
      if (starts_ != line.starts()) {
        starts_ = line.starts();
        refuted_ = false;
      }
      confidence.bound = settled ? tracker_->bound(line, t, q_replica, u_replica) : infinity;
      check(settled, q_replica, u_replica, q, u, confidence);
    }
    tell_widths(q_replica, u_replica, q, u, confidence);
  }

  const HalfWidths& widths() const { return widths_; }
  BoundTracker* tracker() { return tracker_ ? &*tracker_ : nullptr; }

 private:
  void check(bool settled, const Eigen::VectorXd& q_replica, const Eigen::VectorXd& u_replica,
             Eigen::VectorXd& q, Eigen::VectorXd& u, Confidence& confidence);
  void tell_widths(const Eigen::VectorXd& q_replica, const Eigen::VectorXd& u_replica,
                   const Eigen::VectorXd& q, const Eigen::VectorXd& u, Confidence& confidence);

  std::unique_ptr<EnergyMetric> metric_;
  HalfWidths widths_;
  std::optional<BoundTracker> tracker_;
  std::vector<Output> outputs_;
  bool refuted_ = false;          // the filter's estimate was false when last looked at
  std::int64_t refutations_ = 0;  // how often it became so
  std::int64_t starts_ = 0;
  Eigen::VectorXd dq_, du_, dg_;  // scratch
};

}  // namespace sprag
