// Changes of a motion with closed contacts at one instant: impacts (impact_law.h), and the choice
// of the locked set L from the complementarity of contact forces and accelerations,
//
//   0 <= lambda_S  _|_  gamma_S' = a_S + G_SS lambda_S >= 0,   S = closed contacts with gamma = 0,
//
// the time derivative of (4) in Baumann & Leine 2014. Master and replica both use it; they differ
// in the events that close a contact. Nothing here allocates, except flows that are built at first
// use (flows.h).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {

/// Treatment of closed contacts whose directions are linearly dependent.
enum class DependentContacts {
  refuse,  ///< no solution, since the distribution of the load among them is not unique
  share    ///< an independent subset carries the load; contacts that it cannot satisfy are left out
};

/// Result of the choice of a locked set.
struct Locking {
  Solved solved = Solved::yes;  ///< the motion is unchanged unless `yes`
  /// Locked contacts whose force starts from zero, within rounding.
  ContactSet unloaded = 0;
  /// Contacts that cannot be satisfied together with the others, or for which no flow exists
  /// together with the others. They carry no force. Empty if dependent directions are refused.
  ContactSet unsatisfied = 0;
};

/// Result of an impact. The members after `closed` are valid only if it is solved.
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
  /// Those of `contacts` with gamma < 0 by more than rounding.
  ContactSet pressed_in(ContactSet contacts, const Motion& motion) const;
  /// Those of `contacts` with gamma = gamma' = 0 within rounding and gamma'' > 0. None of them may
  /// be locked.
  ContactSet parting(ContactSet contacts, const Motion& motion) const;

  /// Impact of the contacts `closed` with restitution epsilon (indexed by contact, m entries), then
  /// a new locked set among the contacts of `staying` with gamma+ = 0. Locked contacts in
  /// `geometric` are held at g = 0 exactly, the others at their present gap.
  Collision collide(ContactSet closed, std::span<const double> epsilon, ContactSet staying,
                    ContactSet geometric, Motion& motion);

  /// After `collision`: brings gamma of `contacts` to zero too, by impulses of either sign.
  /// Contacts of the collision that this would press in are arrested as well. Then a new locked set
  /// is chosen among all contacts at rest.
  Collision hold(const Collision& collision, ContactSet contacts, ContactSet geometric,
                 Motion& motion);

  /// New locked set among `candidates`, which must have gamma = 0.
  Locking lock(ContactSet candidates, ContactSet geometric, Motion& motion);

  /// Removes `leaving` from the locked set. Returns the unsatisfied contacts, as in Locking.
  ContactSet release(ContactSet leaving, Motion& motion);

  /// Sets `motion` to free flight at (q, u, t).
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
