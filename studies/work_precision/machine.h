// The equation of motion for the general-purpose methods: accelerations from (t, q, u), gaps, and
// the impact law. Diagonal machines (a beam in its modes) cost O(f), so that no method pays for
// unused matrix entries.
#pragma once

#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/model.h"

namespace sprag::work_precision {

class Machine {
 public:
  /// Throws ModelError if M is not positive definite.
  explicit Machine(const Model& model);

  Eigen::Index f() const { return model_.coordinates(); }
  int m() const { return static_cast<int>(model_.contacts.size()); }
  bool diagonal() const { return diagonal_; }
  const Model& model() const { return model_; }
  const Eigen::MatrixXd& W() const { return W_; }          ///< f x m
  const Eigen::MatrixXd& MinvW() const { return MinvW_; }  ///< f x m
  const Eigen::MatrixXd& G() const { return G_; }          ///< m x m, W^T M^-1 W

  /// f(t), f entries. One cosine for each different frequency and phase.
  void force(double t, Eigen::VectorXd& f) const;

  /// u' = M^-1 (f(t) - C u - K q). q, u, a have f entries and do not overlap.
  void accelerate(double t, const double* q, const double* u, double* a) const;

  /// The same with gamma' = 0 at the contacts `locked`. lambda receives their forces [N], in order
  /// of the contacts. Returns false, with undefined a, if their directions are linearly dependent.
  bool accelerate_locked(double t, const double* q, const double* u, ContactSet locked, double* a,
                         ContactVector& lambda) const;

  /// g_i [m] and gamma_i [m/s].
  double gap(int contact, double t, const double* q) const;
  double gap_velocity(int contact, double t, const double* u) const;
  /// s_i''(t) [m/s^2].
  double support_acceleration(int contact, double t) const;

  /// Impact of the contacts `closed` with restitution epsilon (m entries): u becomes u+. Returns
  /// false, with u unchanged, if directions are linearly dependent.
  bool impact(double t, ContactSet closed, const std::vector<double>& epsilon, double* u) const;

 private:
  struct Drive {
    double frequency, phase;
    Eigen::VectorXd force;         // times cos(frequency t + phase)
    Eigen::VectorXd acceleration;  // M^-1 force
  };

  Model model_;
  bool diagonal_ = false;
  Eigen::MatrixXd W_, MinvW_, G_;
  Eigen::VectorXd constant_;
  std::vector<Drive> drives_;
  Eigen::MatrixXd Minv_;                                         // not diagonal
  Eigen::VectorXd constant_acceleration_, c_over_m_, k_over_m_;  // diagonal
  mutable Eigen::VectorXd scratch_;
};

}  // namespace sprag::work_precision
