// What an impact can add to the distance b of machine and replica although its law expands no
// distance: b -> b + d + r.
//
// d: with one restitution epsilon for all participating contacts Poisson's law is P((1 + epsilon) P
// gamma - epsilon gamma), P the projection to gamma >= 0 in the metric of the kinetic energy. It is
// nonexpansive, so that d = 0. A contact that closes to stay takes 0 instead of epsilon. The
// master's result then has gamma_S+ = 0 for these contacts S. It is also the result of another
// nonexpansive map: (1 + epsilon) P gamma - epsilon gamma, then the projection to gamma >= 0 and
// gamma_S = 0. d is the distance between the replica's results by that map and by its own law. It
// is zero if the replica's gamma_S+ are zero, and tends to zero with V. If one contact closes and
// all stay closed, the master has no impulse, and d = 0: an impact that gains no energy does not
// increase the distance to a machine without an impulse.
//
// r: a generous estimate of the rounding of states and event times, and of the master's tolerances:
// contacts that barely open and are held, gaps of completed chatters and of touching contacts.
#pragma once

#include "sprag/contact_event.h"
#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {

/// Whether the replica has the master's impact law: no contact has a replica_restitution.
bool law_is_masters(const Model& model);
/// Whether all impacts are nonexpansive: one contact, or Poisson's law with one restitution.
bool law_is_monotone(const Model& model);

/// The contacts of one impact.
struct ImpactContacts {
  ContactSet before = 0;   ///< closed before it
  ContactSet closing = 0;  ///< close or have a pulse
  ContactSet staying = 0;  ///< those of `closing` with restitution 0
  ContactSet after = 0;    ///< closed after it
};

/// Gap velocities of `contacts` in a motion, ascending; 0 of locked ones.
ContactVector gap_velocities(ContactSet contacts, const Motion& motion);

/// For the events of one replica, in order.
class ImpactRemainder {
 public:
  /// `metric` must outlive this.
  explicit ImpactRemainder(const EnergyMetric& metric);

  /// Starts at the motion's time, with `chi` closed. `state` is the motion's.
  void start(const Motion& motion, const ModalState& state, ContactSet chi);
  /// d + r of an event, 0 of an opening; motion and state of the replica just before it. Infinite
  /// if contacts depend on each other. Does not allocate.
  double of(const ImpactContacts& contacts, const Motion& motion, const ModalState& state);
  /// Largest energy of the replica at closings so far.
  double energy() const { return energy_; }

 private:
  double at_several(const ImpactContacts& contacts, const Motion& motion) const;
  double shift(ContactSet closed, const Motion& motion) const;
  double acceleration() const;

  const EnergyMetric* metric_;
  bool monotone_;
  double force_;  // bound on the acceleration by forces and supports, norm of M
  double energy_ = 0.0;
  Instant started_;
  ContactSet from_start_ = 0;  // closed since the start; the master may be inside their supports
};

}  // namespace sprag
