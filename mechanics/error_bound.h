// An upper bound on the synchronization error energy V of a replica, from the contact events alone.
//
// While no contact is closed, master and replica move by the same linear flow, so that
// V(t + tau) <= sigma_max(tau)^2 V(t), the largest singular value of the flight in the energy norm:
// a 2 x 2 matrix for each mode. While contacts are closed, and at impacts, V does not grow
// (Theorem 1 of Baumann & Leine 2014). So
//
//   V(t) <= B(t) = (sqrt(B(0) prod_k sigma_max(tau_k)^2) + r)^2,
//
// with r for what rounding of states and event times can add. The events must be exact and all
// known, and the impact law monotone: guaranteed() says whether the machine's is.
#pragma once

#include <span>

#include "mechanics/flow.h"

namespace sprag {

/// Everything that changes.
struct ErrorBoundState {
  double share = 1.0;     ///< prod sigma_max^2
  double rounding = 0.0;  ///< r, square root of an energy
  double energy = 0.0;    ///< largest of the replica seen
  Instant free_since;

  /// B for a given B(0) >= 0.
  double bound(double initial) const;
};

class ErrorBound {
 public:
  /// `flows` must outlive this.
  explicit ErrorBound(const Flows& flows);

  /// Whether V cannot grow, whatever happens: one contact, or Poisson's law with one restitution.
  bool guaranteed() const { return guaranteed_; }

  void start(Instant t, ErrorBoundState& state) const;

  /// The motion, of the replica, is at an event before which no contact was closed.
  void land(const Motion& motion, ErrorBoundState& state);

  /// The contacts `closed` (n >= 1) are about to take part in an impact, with restitution epsilon
  /// (indexed by contact); afterwards those of `staying` are closed. With unlike restitutions,
  /// where one closes to stay beside others, V can grow, by a factor that is bounded here, unless
  /// all of them stay closed: the master then has gamma = 0 in all, and no impact gains energy.
  void strike(ContactSet closed, ContactSet staying, std::span<const double> epsilon,
              const Motion& motion, ErrorBoundState& state);

  /// No contact is closed from t on.
  void take_off(Instant t, ErrorBoundState& state) const { state.free_since = t; }

  /// sigma_max(tau)^2 of free flight, 1 on the dense path (flow.h), whose modes are not orthogonal.
  double contraction(double tau);

 private:
  void add_rounding(const Motion& motion, ErrorBoundState& state);
  double growth(ContactSet closed, std::span<const double> epsilon) const;

  const Flows* flows_;
  bool guaranteed_ = false;
  double omega_max_ = 0.0;
  OscillatorState unit_z_, unit_v_, from_z_, from_v_;
  Eigen::ArrayXd no_alpha_;
  Eigen::VectorXd q_, u_;  // scratch
};

}  // namespace sprag
