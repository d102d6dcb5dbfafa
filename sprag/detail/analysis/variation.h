// Differences between a master's motion and motions infinitely close to it: the variational
// equations of the exact flow, and at every instant that is not smooth the saltation matrix
// (Aizerman & Gantmakher, "On the stability of periodic motions", J. Appl. Math. Mech. 22, 1958;
// Muller, "Calculation of Lyapunov exponents for dynamic systems with discontinuities", Chaos,
// Solitons & Fractals 5, 1995; Leine & Nijmeijer, "Dynamics and Bifurcations of Non-Smooth
// Mechanical Systems", 2004, ch. 7). An impact at g_i = 0 comes later by
//
//   delta t = -w_i^T delta q- / gamma_i-,
//
// so that with the impulses Lambda(gamma-) of the impact law, W and G those of the contacts that
// take part,
//
//   delta q+ = delta q- + (u- - u+) delta t
//   delta u+ = delta u- + (a- - a+) delta t + M^-1 W Lambda'(gamma-) (W^T delta u- + gamma'- delta
//   t).
//
// The law is piecewise linear, Lambda' that of its active branch. For a contact that closes to stay
// this ends with w_i^T delta q = w_i^T delta u = 0; so does the end of a chatter, where delta t
// makes no difference (Nordmark & Piiroinen, Nonlinear Dyn. 58, 2009). A release changes nothing.
//
// What it cannot say: where an impact grazes (gamma- = 0) differences grow as their square root;
// where several contacts close at one instant it depends on the difference in which order they
// would, and here they all keep the time of the fastest.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/master.h"

namespace sprag {

class Variation {
 public:
  /// Room for `columns` differences to this master, which must outlive this, and whose advance()
  /// must have been called.
  Variation(Master& master, Eigen::Index columns);

  /// Sets them at the instant t of the master's last advance, f rows each. Differences that the
  /// locked contacts do not allow are projected. Throws SimulationError where a contact is inside
  /// its support: the gap that it keeps is different for each motion.
  void set(Instant t, const Eigen::Ref<const Eigen::MatrixXd>& q,
           const Eigen::Ref<const Eigen::MatrixXd>& u);

  /// Advances the master to t, and them with it. Throws as Master::advance and set. Does not
  /// allocate but for what the master does.
  void advance(Instant t, std::vector<ContactEvent>& events);

  /// Multiplies all of them.
  void scale(double factor);

  /// At the instant of the last call.
  const Eigen::MatrixXd& q() const { return q_; }
  const Eigen::MatrixXd& u() const { return u_; }

 private:
  void move(Instant t);
  void jump(std::span<const ContactEvent> events);
  void find_impulses(ContactSet closing, ContactSet participants);
  ContactVector derivative(const ContactVector& d_gamma) const;
  void add_forces(const Motion& motion, double sign);
  void enter();

  Master& master_;
  const Dynamics& dynamics_;
  Motion before_;  // the master's, behind the last instant at which anything happened
  Instant t_;      // of the differences
  Eigen::MatrixXd q_, u_, z_, v_;
  Eigen::MatrixXd MinvC_;
  Eigen::VectorXd position_, u_minus_, u_plus_, du_, acceleration_;
  Eigen::RowVectorXd delays_;
  // Of the present impact.
  ContactMatrix G_;
  ContactVector gamma_, gamma_rate_, epsilon_, Lambda_, nu_;
};

}  // namespace sprag
