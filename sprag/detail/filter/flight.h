// Flight and impact of a machine as the event filter needs them (event_filter.h), in coordinates x
// (2n entries) in which free flight is cheap. q and u are affine in x at each time, so that
// deviations of x are linear images of those of (q, u). Derivatives by the coordinates c of
// uncertain parameters (P of them) belong to the same interface; P = 0 where the model is exact.
//
// Implementations: ModelFlight (the exact flows of one model, any damping, any locked set) and
// FamilyFlight (the machines that uncertain parameters span, modal damping, one closed contact).
#pragma once

#include <Eigen/Core>

#include "sprag/contact_event.h"

namespace sprag {

class Flight {
 public:
  using Columns = Eigen::Ref<Eigen::MatrixXd>;
  using Vector = Eigen::Ref<Eigen::VectorXd>;
  using ConstVector = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~Flight() = default;

  virtual Eigen::Index n() const = 0;         ///< coordinates f of the machine
  virtual Eigen::Index unknowns() const = 0;  ///< P
  virtual int contacts() const = 0;           ///< m

  /// Selects the machine with these c, P entries; `derivatives`: those by c are wanted as well.
  virtual void set(const ConstVector& c, bool derivatives) = 0;

  /// Whether a flight with these contacts closed can be computed for `duration` [s] in the time of
  /// an event.
  virtual bool can_hold(ContactSet held, double duration) const = 0;
  /// Those of `closed` that can be held together: linearly independent, `first` before the others.
  virtual ContactSet independent(ContactSet first, ContactSet closed) const = 0;

  /// Flight from x at t for tau, which may be negative, with the contacts `held` closed.
  virtual void fly(const ConstVector& x, double t, double tau, ContactSet held) = 0;
  /// Continues from x() for tau. carry() is that of this flight alone then; by_unknowns() is that
  /// since fly().
  virtual void fly_on(double tau, ContactSet held) = 0;

  /// After fly(): x there, and dx / dc, 2n x P, where derivatives are wanted.
  const Eigen::VectorXd& x() const { return x_; }
  const Eigen::MatrixXd& by_unknowns() const { return by_c_; }
  /// Applies dx / dx(start) of the last flight to deviations, 2n rows, in place.
  virtual void carry(Columns dx) = 0;
  /// d^2 x / (dx(start) dc_k) of a free fly(), applied to a deviation of x, in place; for k with
  /// changes_flow(k).
  virtual void carry_by_unknown(Eigen::Index k, Vector dx) const = 0;
  virtual bool changes_flow(Eigen::Index k) const = 0;
  /// Homogeneous flight of deviations for tau with these contacts closed, in place. Leaves the last
  /// flight as it is.
  virtual void turn(double tau, ContactSet held, Columns dx) = 0;
  /// Largest natural frequency [rad per unit of time].
  virtual double largest_frequency() const = 0;
  /// Smallest natural frequency that is not 0; 1 where the machine is rigid.
  virtual double smallest_frequency() const = 0;

  /// After fly(): gap of a contact there, its velocity and acceleration.
  struct Gap {
    double g = 0.0, velocity = 0.0, acceleration = 0.0;
    double length = 0.0;    ///< sum of the absolute terms of g
    double rounding = 0.0;  ///< in units of a rounding of 1
  };
  virtual Gap gap(int contact) const = 0;
  /// A quantity with the zeros of the contact force of a held contact, as g, and its rate, as
  /// velocity.
  virtual Gap force(int contact) const = 0;
  /// Gradients by x of g and of its velocity, 2n entries each, of gap() or of force(). The second
  /// is only filled for gap().
  virtual void gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const = 0;
  /// Gradient by x of the acceleration of a gap in free flight, 2n entries.
  virtual void acceleration_gradient(int contact, Vector of) const = 0;
  /// d(g, velocity) / dc since fly(), of gap() or of force(), P entries each.
  virtual void differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const = 0;

  /// Whether the impact of a contact while others are held can be computed.
  virtual bool can_strike(int contact, ContactSet held) const = 0;
  /// After a free fly() or one with `held`: the impact of a contact. `stays`: it stays closed, its
  /// restitution is 0 then. x() and by_unknowns() are those after it from then on.
  /// \return the contacts that are closed after it, without those that the impact releases
  virtual ContactSet strike(int contact, bool stays, ContactSet held) = 0;
  /// Applies the impact of strike() to deviations of x before it, 2n rows, in place.
  virtual void carry_through(Columns dx) const = 0;
  /// After a free fly() at the present instant: one impact of several contacts, `closing`, of which
  /// `staying` stay closed; `kept` were closed and remain so, `leaving` were and do not. `x` is the
  /// mean, moved with its deviations `dx`. `unknown`: change of x by which the impact law differs
  /// from the branch that is reported, 0 where it does not.
  /// \return false where the directions depend on each other
  virtual bool strike_together(ContactSet closing, ContactSet staying, ContactSet kept,
                               ContactSet leaving, Vector x, Columns dx, Vector unknown) = 0;
  /// An impact that comes later by dt leaves x() at the same instant off by this times dt.
  virtual const Eigen::VectorXd& by_time() const = 0;
  /// Change of x by an impulse on the contact that changes its gap velocity by 1, 2n entries.
  virtual void along(int contact, Vector dx) const = 0;
  virtual double restitution(int contact) const = 0;

  /// x of a state at t, f entries each, and back.
  virtual void enter(const ConstVector& q, const ConstVector& u, double t, Vector x) = 0;
  virtual void state(const ConstVector& x, double t, Vector q, Vector u) = 0;
  /// (dq, du) = to_state() dx, 2f x 2n, of the machine of nominal parameters.
  virtual const Eigen::MatrixXd& to_state() const = 0;
  virtual const Eigen::MatrixXd& from_state() const = 0;
  /// Sum over columns of twice their energy, q^T K q + u^T M u.
  virtual double twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const = 0;

 protected:
  Eigen::VectorXd x_;
  Eigen::MatrixXd by_c_;
};

}  // namespace sprag
