// The impact of contacts that are reported to close: the active branch of the impact law, whatever
// the signs of gamma- are in the estimate. With the impulses Lambda along the directions d_k = M^-1
// w_k, less what those contacts take that stay closed, and G_kl = w_k^T d_l,
//
//   u+ = u- + sum_k d_k Lambda_k,   Poisson: Lambda = -(1 + E) G^-1 gamma-,
//                                   Newton:  Lambda = -G^-1 (1 + E) gamma-.
//
// Linear in gamma-, so that it moves mean and covariance alike.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {

/// A contact that closes, and how.
struct Closing {
  int contact = 0;
  double epsilon = 0.0;                                           ///< 0 where it stays closed
  double gamma = 0.0, gamma_rate = 0.0, gamma_second_rate = 0.0;  ///< before the impact
};

/// The impact of one contact while others are held (gamma = 0), by the impact law itself. It is
/// homogeneous in gamma_i-, so that who of them is thrown off depends on nothing else.
struct SingleImpact {
  Solved solved = Solved::yes;
  double change = 0.0;     ///< of gamma_i, over -gamma_i-: 1 + epsilon_i unless others give back
  ContactSet staying = 0;  ///< of those that were held; the others are thrown off
  ContactVector Lambda;    ///< of the contact and of those held, by ascending index, for a change
                           ///< of gamma_i by one
};
SingleImpact single_impact(const Dynamics& dynamics, int contact, double epsilon, ContactSet held);

class ActiveImpact {
 public:
  /// `dynamics` must outlive this. Nothing else here allocates.
  explicit ActiveImpact(const Dynamics& dynamics);

  /// From now on the impact of `closings`, which must stay as they are, while `staying` are held;
  /// those of `leaving` were closed before it and are not after it.
  void set(const std::vector<Closing>& closings, ContactSet staying, ContactSet leaving);

  /// Adds u+ - u- to `u`, f entries, where the k-th closing comes with gamma(k). False, and nothing
  /// added, where the directions depend on each other.
  template <typename Gamma, typename Velocities>
  bool add_jump(const Gamma& gamma, Velocities&& u) {
    for (Eigen::Index k = 0; k < size(); ++k) gamma_[k] = gamma(k);
    if (!find_impulses()) return false;
    for (Eigen::Index k = 0; k < size(); ++k) u += Lambda_[k] * directions_.col(k);
    return true;
  }

  /// What the impact law itself makes of the mean, where which contacts take an impulse is not
  /// certain: several close, or others are closed before or after.
  enum class Decision {
    same,        ///< as the branch
    other,       ///< another impact, with which the reports would have been others
    as_reported  ///< another impact that agrees with the reports
  };
  /// At time t [s], from u before to u after the branch, f entries each; `difference`: what the law
  /// adds to that.
  Decision decide(const Eigen::VectorXd& before, const Eigen::VectorXd& after, double t,
                  Eigen::VectorXd& difference) const;

 private:
  Eigen::Index size() const { return static_cast<Eigen::Index>(closings_->size()); }
  const Closing& closing(Eigen::Index k) const { return (*closings_)[static_cast<std::size_t>(k)]; }
  bool find_impulses();

  const Dynamics* dynamics_;
  const std::vector<Closing>* closings_ = nullptr;
  ContactSet staying_ = 0, leaving_ = 0;
  Eigen::MatrixXd directions_;  // f x m
  ContactMatrix G_;
  ContactVector gamma_, Lambda_;
};

}  // namespace sprag
