// Interface of a machine's flight and impact for the event filter (event_filter.h), in coordinates
// x (2n entries) in which free flight is cheap. At each time q and u are affine in x, so deviations
// of x map linearly to deviations of (q, u). The interface includes derivatives by the coordinates
// c of P uncertain parameters; P = 0 for an exact model.
//
// Implementations: ModelFlight (exact flows of one model, any damping, any locked set) and
// FamilyFlight (the machines that the uncertain parameters span, any damping, any held set).
#pragma once

#include <Eigen/Core>

#include "sprag/contact_event.h"

namespace sprag {

/// Step of differences in a restitution and in a coordinate of a parameter. The truncation error is
/// far below any deviation, and the rounding error of the difference stays small.
inline constexpr double difference_step = 4e-6;

class Flight {
 public:
  using Columns = Eigen::Ref<Eigen::MatrixXd>;
  using Vector = Eigen::Ref<Eigen::VectorXd>;
  using ConstVector = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~Flight() = default;

  virtual Eigen::Index n() const = 0;         ///< number of coordinates f of the machine
  virtual Eigen::Index unknowns() const = 0;  ///< P
  virtual int contacts() const = 0;           ///< m

  /// Selects the machine with the parameter coordinates c, P entries. `derivatives`: later calls
  /// also compute the derivatives by c.
  virtual void set(const ConstVector& c, bool derivatives) = 0;

  /// Whether a flight with these contacts closed can be computed: their directions must be linearly
  /// independent.
  virtual bool can_hold(ContactSet held) const = 0;
  /// Returns the contacts of `closed` that can be held together, that is with linearly independent
  /// directions. Those of `first` have priority.
  virtual ContactSet independent(ContactSet first, ContactSet closed) const = 0;

  /// Moves from x at t by tau, which may be negative, with the contacts `held` closed.
  virtual void fly(const ConstVector& x, double t, double tau, ContactSet held) = 0;
  /// Continues from x() by tau. After it, carry() refers to this flight alone, by_unknowns() to all
  /// since fly().
  virtual void fly_on(double tau, ContactSet held) = 0;

  /// After fly(): x at its end, and dx / dc, 2n x P, if derivatives are selected.
  const Eigen::VectorXd& x() const { return x_; }
  const Eigen::MatrixXd& by_unknowns() const { return by_c_; }
  /// Maps deviations at the start of the last flight to its end, dx <- (dx / dx(start)) dx, 2n
  /// rows, in place.
  virtual void carry(Columns dx) = 0;
  /// After a free fly(): maps a deviation of x in place by d^2 x / (dx(start) dc_k), for k with
  /// changes_flow(k).
  virtual void carry_by_unknown(Eigen::Index k, Vector dx) = 0;
  virtual bool changes_flow(Eigen::Index k) const = 0;
  /// Maps deviations in place by the homogeneous flow over tau with these contacts closed. Does not
  /// change the last flight.
  virtual void turn(double tau, ContactSet held, Columns dx) = 0;
  /// Largest natural frequency [rad per unit of time].
  virtual double largest_frequency() const = 0;
  /// Smallest natural frequency that is not 0; 1 where the machine is rigid.
  virtual double smallest_frequency() const = 0;

  /// After fly(): gap of a contact at its end, with the gap's velocity and acceleration.
  struct Gap {
    double g = 0.0, velocity = 0.0, acceleration = 0.0;
    double length = 0.0;    ///< sum of the absolute terms of g
    double rounding = 0.0;  ///< magnitude to which the rounding error of g is proportional
  };
  virtual Gap gap(int contact) const = 0;
  /// After a free fly(): time for which all gaps stay positive without a closed contact, as far as
  /// a search of bounded cost shows. All gaps must be positive.
  virtual double open_for() = 0;
  /// A quantity with the zeros of a held contact's force, as g, and its rate, as velocity.
  virtual Gap force(int contact) const = 0;
  /// Gradients by x of g and of its velocity, 2n entries each, of gap() or of force(). For force()
  /// the gradient of the velocity is not computed.
  virtual void gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const = 0;
  /// Gradient by x of the acceleration of a gap in free flight, 2n entries.
  virtual void acceleration_gradient(int contact, Vector of) const = 0;
  /// Total derivatives d(g, velocity) / dc since fly(), of gap() or of force(), P entries each.
  virtual void differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const = 0;

  /// After fly(): applies the impact of a contact while `held` are closed. x() and by_unknowns()
  /// then refer to the state after the impact. `stays`: the contact stays closed, with restitution
  /// 0. `sigma`: standard deviation of the gap velocity before the impact, for a restitution that
  /// depends on it.
  /// \return the contacts that are closed after the impact, without those that it releases
  virtual ContactSet strike(int contact, bool stays, ContactSet held, double sigma = 0.0) = 0;
  /// After strike(): deviation of x() that carry_through() lacks, since a restitution depends on
  /// the speed. Empty if none does.
  const Eigen::VectorXd& bend() const { return bend_; }
  /// Maps deviations of x before the impact of strike() to those after it at a fixed impact time,
  /// 2n rows, in place.
  virtual void carry_through(Columns dx) const = 0;
  /// After a free fly(): one simultaneous impact of the contacts `closing`, of which `staying` stay
  /// closed. `kept` were closed and stay so, `leaving` were closed and open. Moves the mean `x` and
  /// its deviations `dx`. `unknown`: change of x by which the impact law on the mean differs from
  /// the reported branch, else 0; the filter adds it to the covariance.
  /// \return false if the directions are linearly dependent
  virtual bool strike_together(ContactSet closing, ContactSet staying, ContactSet kept,
                               ContactSet leaving, Vector x, Columns dx, Vector unknown) = 0;
  /// After strike(): derivative of x() at a fixed instant by the time of the impact. With
  /// carry_through() it forms the saltation matrix (di Bernardo et al. 2008).
  virtual const Eigen::VectorXd& by_time() const = 0;
  /// Change of x by an impulse on the contact that changes its gap velocity by 1, 2n entries.
  virtual void along(int contact, Vector dx) const = 0;
  /// Restitution of the slowest impacts, and that at a gap velocity before the impact.
  virtual double restitution(int contact) const = 0;
  virtual double restitution(int contact, double gamma) const = 0;

  /// Converts a state (q, u) at t, f entries each, to x, and back.
  virtual void enter(const ConstVector& q, const ConstVector& u, double t, Vector x) = 0;
  virtual void state(const ConstVector& x, double t, Vector q, Vector u) = 0;
  /// (dq, du) = to_state() dx, for the machine with nominal parameters.
  virtual const Eigen::MatrixXd& to_state() const = 0;
  virtual const Eigen::MatrixXd& from_state() const = 0;
  /// Twice the energy, q^T K q + u^T M u, summed over the columns.
  virtual double twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const = 0;

 protected:
  Eigen::VectorXd x_, bend_;
  Eigen::MatrixXd by_c_;
};

}  // namespace sprag
