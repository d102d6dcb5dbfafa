// An upper bound on the synchronization error energy V of a replica, from the contact events alone.
//
// With b = sqrt(B), which starts at sqrt(B(0)):
//
//   free flight of length tau     b -> |exp(A tau)| b        largest singular value, energy norm
//   contacts closed               b -> b                     Theorem 1 of Baumann & Leine 2014
//   impact                        b -> b + d + r
//
// so that V(t) <= B(t) = (prod_k |exp(A tau_k)| sqrt(B(0)) + what the impacts added, contracted
// since)^2. A flight that is under way counts as far as it has come.
//
// d: with one restitution epsilon for all contacts that take part, Poisson's law is P((1 + epsilon)
// P gamma - epsilon gamma), P the nearest point with gamma >= 0 in the metric of the machine's
// energy, and expands no distance: d = 0. A contact that closes to stay takes 0 beside others'
// epsilon. Since the master ends that impact with gamma_S+ = 0 in those, it has done as well what
// this does, which expands nothing either: (1 + epsilon) P gamma - epsilon gamma, then the nearest
// point with gamma >= 0 and gamma_S = 0. d is the distance from where the replica would come by
// that to where it comes by its own law. It is zero where the replica's gamma_S+ are, and goes to
// zero with V. Where one closes and all stay closed the master takes no impulse, and d = 0: an
// impact that gains no energy does not lead away from a machine that takes none.
//
// r: what rounding of states and event times can add, and the master's tolerances: what hardly
// parts and is pulled to rest, the gap of what it completes or takes for a touch. Estimated,
// generously.
//
// The events must be exact and all known, and the law one that expands nothing: guaranteed() says
// whether the machine's is.
#pragma once

#include <span>

#include "sprag/detail/bound/flight_contraction.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/scene.h"

namespace sprag {

/// Whether the replica's impacts are the master's: no contact has a replica_restitution.
bool law_is_masters(const Model& model);
/// Whether no impact expands a distance: one contact, or Poisson's law with one restitution.
bool law_is_monotone(const Model& model);

/// Everything that changes.
struct ErrorBoundState {
  double share = 1.0;      ///< prod |exp(A tau)|^2 of the flights that are over
  double remainder = 0.0;  ///< what impacts added to b, contracted since
  double energy = 0.0;     ///< largest of the replica seen
  Instant started;
  Instant free_since;
  ContactSet from_start = 0;  ///< closed ever since the start: the master may be inside these
};

class ErrorBound {
 public:
  /// `flows` must outlive this. Throws ModelError.
  explicit ErrorBound(const Flows& flows);

  /// Whether V cannot grow by the law: one contact, or Poisson's law with one restitution; and the
  /// replica's is the master's.
  bool guaranteed() const { return guaranteed_; }

  /// `chi`: closed contacts.
  void start(const Motion& motion, ContactSet chi, ErrorBoundState& state);

  /// The replica's motion is at an event, before its impact: `before` were closed, `closing` close
  /// or pulse, `chi` are closed afterwards; restitution epsilon of all contacts.
  void event(ContactSet before, ContactSet closing, ContactSet chi, std::span<const double> epsilon,
             const Motion& motion, ErrorBoundState& state);

  /// B at t for a given B(0) >= 0; `free`: no contact is closed.
  double bound(const ErrorBoundState& state, double initial, Instant t, bool free);

  /// |exp(A tau)|^2 of free flight, at most.
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
  double force_ = 0.0;     // largest acceleration by forces and supports, norm of M
  Eigen::VectorXd q_, u_;  // scratch
};

/// B(0) of a scene, the sum of its [replica] uncertainty; +infinity where a bound on V cannot be
/// given: no uncertainty of the start, or a machine that drifts, whose event times jitter or whose
/// parameters are uncertain. With tolerances the bound is theirs (sprag/detail/bound/guarantee.h),
/// and this is B(0) whatever else the scene says.
double initial_bound(const Scene& scene);

}  // namespace sprag
