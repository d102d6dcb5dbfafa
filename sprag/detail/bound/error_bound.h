// Upper bound on the synchronization error energy V of a replica, from the contact events alone.
//
// With b = sqrt(B), which starts at sqrt(B(0)):
//
//   free flight of length tau     b -> |exp(A tau)| b        largest singular value, energy norm
//   contacts closed               b -> b                     Theorem 1 of Baumann & Leine 2014
//   impact                        b -> b + d + r
//
// so that V(t) <= B(t) = (prod_k |exp(A tau_k)| sqrt(B(0)) + contracted additions of the
// impacts)^2. The present flight counts up to t.
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
//
// The events must be exact and complete, and the impact law nonexpansive (guaranteed()).
#pragma once

#include <span>

#include "sprag/detail/bound/flight_contraction.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/scene.h"

namespace sprag {

/// Whether the replica has the master's impact law: no contact has a replica_restitution.
bool law_is_masters(const Model& model);
/// Whether all impacts are nonexpansive: one contact, or Poisson's law with one restitution.
bool law_is_monotone(const Model& model);

/// Everything that changes.
struct ErrorBoundState {
  double share = 1.0;      ///< prod |exp(A tau)|^2 of the completed flights
  double remainder = 0.0;  ///< additions of impacts to b, contracted since
  double energy = 0.0;     ///< largest energy of the replica so far
  Instant started;
  Instant free_since;
  ContactSet from_start = 0;  ///< closed since the start; the master may be inside their supports
};

class ErrorBound {
 public:
  /// `flows` must outlive this. Throws ModelError.
  explicit ErrorBound(const Flows& flows);

  /// Whether V cannot grow at impacts: law_is_monotone() and law_is_masters().
  bool guaranteed() const { return guaranteed_; }

  /// `chi`: closed contacts.
  void start(const Motion& motion, ContactSet chi, ErrorBoundState& state);

  /// Takes an event, with the replica's motion before its impact: `before` are closed before it,
  /// `closing` close or have a pulse, `chi` are closed after it; epsilon of all contacts.
  void event(ContactSet before, ContactSet closing, ContactSet chi, std::span<const double> epsilon,
             const Motion& motion, ErrorBoundState& state);

  /// B at t for a given B(0) >= 0; `free`: no contact is closed.
  double bound(const ErrorBoundState& state, double initial, Instant t, bool free);

  /// Upper bound on |exp(A tau)|^2 of free flight.
  double contraction(double tau) { return flight_.square(tau); }

 private:
  void note_energy(const Motion& motion, ErrorBoundState& state);
  void strike(ContactSet before, ContactSet closing, ContactSet chi,
              std::span<const double> epsilon, const Motion& motion, ErrorBoundState& state) const;
  double spread(ContactSet closed) const;
  double shift(ContactSet closed, const Motion& motion) const;
  double chatter_rest(Instant t) const;
  double acceleration(double energy) const;

  const Flows* flows_;
  bool guaranteed_ = false;
  FlightContraction flight_;
  double force_ = 0.0;     // bound on the acceleration by forces and supports, norm of M
  Eigen::VectorXd q_, u_;  // scratch
};

/// B(0) of a scene: the sum of its [replica] uncertainty. It is +infinity if no bound on V exists:
/// no uncertainty of the start, or drift, jitter or uncertain parameters. In a scene with
/// tolerances only the uncertainty matters (sprag/detail/bound/guarantee.h).
double initial_bound(const Scene& scene);

}  // namespace sprag
