// What happens at one instant to a motion with closed contacts: impacts (impact_law.h) and the
// choice of the locked set L from the complementarity of contact forces and accelerations,
//
//   0 <= lambda_S  _|_  gamma_S' = a_S + G_SS lambda_S >= 0,   S = closed contacts with gamma = 0,
//
// the rate of (4) in Baumann & Leine 2014. Master and replica share all of it; they differ in what
// closes a contact. Nothing here allocates, but for flows that are built at first use (flows.h).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {

/// What to do where the directions of closed contacts depend on each other.
enum class DependentContacts {
  refuse,  ///< no motion: which of them carries what is a guess
  share    ///< independent ones carry it all; what cannot be satisfied beside them is left out
};

/// How a locked set has come out.
struct Locking {
  Solved solved = Solved::yes;  ///< the motion is as it was unless `yes`
  /// Locked contacts whose force starts from zero, within rounding.
  ContactSet unloaded = 0;
  /// Contacts that cannot be satisfied beside the others, or together with which the machine has no
  /// flow. They have no force. None where dependent directions are refused.
  ContactSet unsatisfied = 0;
};

/// How an impact has come out. What follows `closed` has a meaning only where it is solved.
struct Collision : Locking {
  ContactSet closed = 0;     ///< contacts that took part
  ContactSet struck = 0;     ///< those that took an impulse
  ContactSet resting = 0;    ///< those that end with gamma+ = 0
  ContactVector gamma_plus;  ///< m entries: gamma_i+ of those that took part, else 0
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
  /// held at g = 0 exactly, others at the gap they have.
  Collision collide(ContactSet closed, std::span<const double> epsilon, ContactSet staying,
                    ContactSet geometric, Motion& motion);

  /// After `collision`: takes gamma of `contacts` to zero as well, pulling where need be, and of
  /// others that took part and that this would press in; then a new locked set among all that rest.
  Collision hold(const Collision& collision, ContactSet contacts, ContactSet geometric,
                 Motion& motion);

  /// New locked set among `candidates`, whose gamma is zero.
  Locking lock(ContactSet candidates, ContactSet geometric, Motion& motion);

  /// Takes `leaving` out of the locked set. Returns what is unsatisfied then, as in Locking.
  ContactSet release(ContactSet leaving, Motion& motion);

  /// Puts a free motion at (q, u, t).
  void start(const State& state, Instant t, Motion& motion);

 private:
  Locking enter_locked(ContactSet candidates, ContactSet geometric, ContactSet unsatisfied,
                       Motion& motion);
  ContactSet choose(ContactSet candidates, const Motion& motion, Locking& locking) const;
  const Flow& flow_of(ContactSet locked, ContactSet& unsatisfied) const;
  void enter(ContactSet locked, ContactSet geometric, ContactSet& unsatisfied, Motion& motion);
  void read_state(const Motion& motion);
  double velocity_scale(int contact, const Motion& motion) const;
  double acceleration(int contact, const Motion& motion, double& magnitude) const;

  const Flows* flows_;
  DependentContacts dependent_;
  std::vector<Functional> acceleration_;
  State state_;                  // scratch: q, u at the instant
  Eigen::VectorXd held_locked_;  // scratch
};

}  // namespace sprag
