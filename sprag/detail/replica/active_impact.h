// Impact of contacts that are reported to close: the active branch of the impact law, for any signs
// of gamma- in the estimate. The impulses Lambda act along the directions d_k, which are M^-1 w_k
// with the reaction of the contacts that stay closed. With G_kl = w_k^T d_l,
//
//   u+ = u- + sum_k d_k Lambda_k,   Poisson: Lambda = -(1 + E) G^-1 gamma-,
//                                   Newton:  Lambda = -G^-1 (1 + E) gamma-.
//
// The branch is linear in gamma-, so that it maps mean and covariance in the same way, unless a
// restitution depends on the speed v = -gamma-. Then the change of Lambda by d gamma- is
//
//   Poisson: -(1 + E) G^-1 d gamma- + (d epsilon/dv d gamma-) . (G^-1 gamma-), . by components,
//   Newton:  -G^-1 (1 + d(epsilon v)/dv) d gamma-.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {

/// A contact that closes.
struct Closing {
  int contact = 0;
  ImpactRestitution restitution = {};  ///< 0 if it stays closed
  double gamma = 0.0;                  ///< of the mean before the impact
};

/// Impact of one contact while others are held (gamma = 0), by the impact law itself. The law is
/// homogeneous in gamma_i-, so that the set of released contacts does not depend on gamma_i-.
struct SingleImpact {
  Solved solved = Solved::yes;
  double change = 0.0;  ///< change of gamma_i over -gamma_i-; 1 + epsilon_i unless other contacts
                        ///< return impulse
  ContactSet staying = 0;  ///< held contacts that stay closed; the others are released
  ContactVector Lambda;    ///< impulses on the contact and the held ones, by ascending index, for a
                           ///< change of gamma_i by 1
};
/// G and the restitutions are those of all contacts; `epsilon` is that of this impact. With
/// d(epsilon v)/dv in its place the result is the derivative of the impact by gamma_i-.
SingleImpact single_impact(const Eigen::MatrixXd& G, ImpactLaw law,
                           const Eigen::VectorXd& restitution, int contact, double epsilon,
                           ContactSet held);

class ActiveImpact {
 public:
  /// `dynamics` must outlive this. Only the constructor allocates.
  explicit ActiveImpact(const Dynamics& dynamics);

  /// Sets the impact: `closings`, which must not change until the next set(), while `staying` are
  /// held. Contacts of `leaving` are closed before the impact and open after it.
  void set(const std::vector<Closing>& closings, ContactSet staying, ContactSet leaving);

  /// Adds u+ - u- of the mean to `u`, f entries. Returns false and adds nothing if the directions
  /// are linearly dependent.
  template <typename Velocities>
  bool add_jump(Velocities&& u) {
    for (Eigen::Index k = 0; k < size(); ++k) gamma_[k] = closing(k).gamma;
    if (!find_impulses(false)) return false;
    for (Eigen::Index k = 0; k < size(); ++k) u += Lambda_[k] * directions_.col(k);
    return true;
  }
  /// The same for its change by a change d_gamma(k) of the gap velocity of the k-th closing.
  template <typename Gamma, typename Velocities>
  bool add_change(const Gamma& d_gamma, Velocities&& u) {
    for (Eigen::Index k = 0; k < size(); ++k) gamma_[k] = d_gamma(k);
    if (!find_impulses(true)) return false;
    for (Eigen::Index k = 0; k < size(); ++k) u += Lambda_[k] * directions_.col(k);
    return true;
  }

  /// Result of the impact law itself for the mean, where several contacts close or others are
  /// closed, so that the branch may be another.
  enum class Decision {
    same,        ///< the same as the branch
    other,       ///< another impact, which contradicts the reports
    as_reported  ///< another impact, which agrees with the reports
  };
  /// At time t [s], u before and after the branch, f entries each. `difference` receives u+ of the
  /// law minus u+ of the branch.
  Decision decide(const Eigen::VectorXd& before, const Eigen::VectorXd& after, double t,
                  Eigen::VectorXd& difference) const;

 private:
  Eigen::Index size() const { return static_cast<Eigen::Index>(closings_->size()); }
  const Closing& closing(Eigen::Index k) const { return (*closings_)[static_cast<std::size_t>(k)]; }
  bool find_impulses(bool of_change);

  const Dynamics* dynamics_;
  const std::vector<Closing>* closings_ = nullptr;
  ContactSet staying_ = 0, leaving_ = 0;
  Eigen::MatrixXd directions_;  // f x m
  ContactMatrix G_;
  ContactVector gamma_, Lambda_;
  ContactVector compression_;  // -G^-1 gamma- of the mean
};

}  // namespace sprag
