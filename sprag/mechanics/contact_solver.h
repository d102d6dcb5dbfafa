// What happens at one instant to a motion with closed contacts: impacts (impact_law.h) and the
// choice of the locked set L from the complementarity of contact forces and accelerations,
//
//   0 <= lambda_S  _|_  gamma_S' = a_S + G_SS lambda_S >= 0,   S = closed contacts with gamma = 0,
//
// the rate of (4) in Baumann & Leine 2014. Master and replica share all of it; they differ in what
// closes a contact. Nothing here allocates, but for flows that are built at first use (flow.h).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/impact_law.h"

namespace sprag {

/// What to do where the directions of closed contacts depend on each other.
enum class DependentContacts {
  refuse,  ///< no motion: which of them carries what is a guess
  share    ///< independent ones carry it all; what cannot be satisfied beside them is left out
};

class ContactSolver {
 public:
  /// `flows` must outlive this.
  ContactSolver(const Flows& flows, DependentContacts dependent);

  /// g_i and gamma_i of a motion.
  double gap(int contact, const Motion& motion) const;
  double gap_velocity(int contact, const Motion& motion) const;
  /// Those of `contacts` with gamma < 0 beyond all roundings.
  ContactSet pressed_in(ContactSet contacts, const Motion& motion) const;
  /// Those of `contacts`, none of them locked, with gamma = gamma' = 0 up to roundings and
  /// gamma'' > 0.
  ContactSet parting(ContactSet contacts, const Motion& motion) const;

  /// Impact on the contacts `closed` with restitution epsilon (indexed by contact, m entries), then
  /// a new locked set among those of `staying` whose gamma+ is zero. Contacts in `geometric` are
  /// held at g = 0 exactly, others at the gap they have. On `dependent` the motion is unchanged.
  /// gamma_plus() and resting() describe the outcome.
  Solved collide(ContactSet closed, std::span<const double> epsilon, ContactSet staying,
                 ContactSet geometric, Motion& motion);

  /// After collide(): takes gamma of `contacts` to zero as well, pulling where need be, and of
  /// those of `closed` that this would press in; then a new locked set among all that rest. On
  /// `dependent` the motion is unchanged. gamma_plus() and resting() are kept up.
  Solved hold(ContactSet contacts, ContactSet closed, ContactSet geometric, Motion& motion);

  /// New locked set among `candidates`, whose gamma is zero.
  Solved lock(ContactSet candidates, ContactSet geometric, Motion& motion);

  /// Takes `leaving` out of the locked set.
  void release(ContactSet leaving, Motion& motion);

  /// Puts a free motion at (q, u, t).
  void start(const State& state, Instant t, Motion& motion);

  /// After collide(): gamma_i+ of the contacts that took part.
  double gamma_plus(int contact) const { return gamma_plus_[static_cast<std::size_t>(contact)]; }
  /// After collide(): contacts that took an impulse.
  ContactSet struck() const { return struck_; }
  /// After collide(): contacts of the impact that end with gamma+ = 0.
  ContactSet resting() const { return resting_; }
  /// After any of these: locked contacts whose force starts from zero, within rounding.
  ContactSet unloaded() const { return unloaded_; }
  /// After any of these: contacts that cannot be satisfied beside the others, or together with
  /// which the machine has no flow. They have no force. None where dependent directions are
  /// refused.
  ContactSet unsatisfied() const { return unsatisfied_; }
  /// gamma_i' without contact forces, at (q, u, t) of a motion.
  double free_acceleration(int contact, const Motion& motion);

 private:
  Solved enter_locked(ContactSet candidates, ContactSet geometric, Motion& motion);
  Solved solve(const ContactMatrix& A, const ContactVector& b, const ContactVector& noise,
               ContactVector& x, ContactVector& y, ContactSet contacts);
  void leave_out(ContactSet rows, ContactSet contacts);
  const Flow& flow_of(ContactSet locked);
  void enter(ContactSet locked, ContactSet geometric, Motion& motion);
  void read_state(const Motion& motion);
  double velocity_scale(int contact, const Motion& motion) const;
  double acceleration(int contact, const Motion& motion, double& magnitude) const;

  const Flows* flows_;
  DependentContacts dependent_;
  std::vector<Functional> acceleration_;
  State state_;  // scratch: q, u at the instant
  std::vector<double> gamma_plus_;
  std::vector<double> held_;     // scratch: gap of each contact at the instant
  Eigen::VectorXd held_locked_;  // scratch
  ContactSet resting_ = 0;
  ContactSet struck_ = 0;
  ContactSet unloaded_ = 0;
  ContactSet unsatisfied_ = 0;
};

}  // namespace sprag
