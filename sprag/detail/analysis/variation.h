// Infinitesimal differences to a master's motion: the variational equations of the exact flow, and
// the saltation matrix at every event (Aizerman & Gantmakher, "On the stability of periodic
// motions", J. Appl. Math. Mech. 22, 1958; Muller, "Calculation of Lyapunov exponents for dynamic
// systems with discontinuities", Chaos, Solitons & Fractals 5, 1995; Leine & Nijmeijer, "Dynamics
// and Bifurcations of Non-Smooth Mechanical Systems", 2004, ch. 7). An impact at g_i = 0 is shifted
// in time by
//
//   delta t = -w_i^T delta q- / gamma_i-,
//
// so with the impulses Lambda(gamma-) of the impact law, and W and G of the participating contacts,
//
//   delta q+ = delta q- + (u- - u+) delta t
//   delta u+ = delta u- + (a- - a+) delta t
//              + M^-1 W Lambda'(gamma-) (W^T delta u- + gamma'- delta t).
//
// The law is piecewise linear; Lambda' is the derivative of its active branch. A contact that
// closes and stays closed ends with w_i^T delta q = w_i^T delta u = 0. So does the end of a
// chatter, where delta t has no effect (Nordmark & Piiroinen, Nonlinear Dyn. 58, 2009). A release
// changes nothing.
//
// Limits: at a grazing impact (gamma- = 0) differences grow as a square root. If several contacts
// close at one instant, their order depends on the difference; here all are shifted by the time of
// the fastest.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/master.h"

namespace sprag {

class Variation {
 public:
  /// Reserves `columns` differences to this master. The master must outlive this, and its advance()
  /// must have been called.
  Variation(Master& master, Eigen::Index columns);

  /// Sets the differences at the instant t of the master's last advance, f rows each, projected to
  /// those that the locked contacts allow. Throws SimulationError if a contact is inside its
  /// support: the gap that it keeps differs between neighbouring motions.
  void set(Instant t, const Eigen::Ref<const Eigen::MatrixXd>& q,
           const Eigen::Ref<const Eigen::MatrixXd>& u);

  /// Advances the master and the differences to t. Throws as Master::advance and set. Does not
  /// allocate, except in the master.
  void advance(Instant t, std::vector<ContactEvent>& events);

  /// Multiplies all differences.
  void scale(double factor);

  /// The differences at the instant of the last call.
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
  Motion before_;  // the master's, after the last event
  Instant t_;      // time of the differences
  Eigen::MatrixXd q_, u_, z_, v_;
  Eigen::MatrixXd MinvC_;
  Eigen::VectorXd position_, u_minus_, u_plus_, du_, acceleration_;
  Eigen::RowVectorXd delays_;
  // Data of the present impact.
  ContactMatrix G_;
  ContactVector gamma_, gamma_rate_, epsilon_, slope_, Lambda_, nu_;
};

}  // namespace sprag
