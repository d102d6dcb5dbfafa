// Flight and impact of the machines that the unknowns of a scene span (machine_family.h), free or
// with one contact that stays closed,
//
//   y'' + C y' + K y = F(t) + w lambda,   w^T y'' + s'' = 0 where it is closed,
//
// with derivatives by the state and by the unknowns' coordinates c: those by the state in closed
// form, those by c by central differences, each between two machines of the family. In modal
// coordinates y of q = V y. Does not allocate once it is made.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "sprag/identification/machine_family.h"
#include "sprag/mechanics/oscillators.h"

namespace sprag {

class JointFlight {
 public:
  /// The family must be modal, and must outlive this.
  explicit JointFlight(const MachineFamily& family);

  Eigen::Index n() const { return family_->n(); }
  Eigen::Index unknowns() const { return static_cast<Eigen::Index>(family_->unknowns().size()); }

  /// The machine of these coordinates from now on; `derivatives`: those by c are wanted as well.
  void set(const Eigen::Ref<const Eigen::VectorXd>& c, bool derivatives);

  /// From (y, y') = x, 2n entries, at t to t + tau; tau may be negative. `held`: the contact that
  /// is closed, -1 for none. Its flight costs in proportion to tau: cost_of_holding().
  void fly(const Eigen::Ref<const Eigen::VectorXd>& x, double t, double tau, int held = -1);
  /// Steps that a flight of tau takes with a contact closed.
  double cost_of_holding(double tau) const;

  /// After fly(): (y, y') there, and d(y, y') / dc, 2n x P, where derivatives are wanted.
  const Eigen::VectorXd& x() const { return x_; }
  const Eigen::MatrixXd& by_unknowns() const { return by_c_; }
  /// d(y, y') / dx applied to a deviation of x, in place.
  void carry(Eigen::Ref<Eigen::VectorXd> dx);
  /// Continues from the present x(), each machine of the difference quotients from its own, for
  /// tau. carry() is that of this flight alone then; by_unknowns() that since fly().
  void fly_on(double tau, int held = -1);
  /// d^2(y, y') / (dx dc_k) of a free fly(), applied to a deviation of x, in place; for an unknown
  /// with changes_flow(k).
  void carry_by_unknown(Eigen::Index k, Eigen::Ref<Eigen::VectorXd> dx) const;
  bool changes_flow(Eigen::Index k) const {
    return variants_[static_cast<std::size_t>(1 + 2 * k)].own_flow;
  }
  /// Free homogeneous flight of a deviation for tau, in place.
  void turn(double tau, Eigen::Ref<Eigen::VectorXd> dx);
  /// The machine of the coordinates that were set.
  const Machine& machine() const { return centre().machine; }
  /// Largest natural frequency [rad per unit of time].
  double largest_frequency() const;

  /// After fly(): gap of a contact there, its velocity and acceleration.
  struct Gap {
    double g = 0.0, velocity = 0.0, acceleration = 0.0;
    double length = 0.0;    ///< sum of the absolute terms of g, as y has them
    double rounding = 0.0;  ///< in units of a rounding of 1
  };
  Gap gap(int contact) const;
  /// w^T w lambda of a held contact, as g, and its rate, as velocity; the force is 0 where the
  /// contact opens.
  Gap force(int contact) const;
  /// d(g, velocity) / dc since fly(), of gap() or of force(), P entries each.
  void differences(int contact, bool of_force, Eigen::Ref<Eigen::VectorXd> of_g,
                   Eigen::Ref<Eigen::VectorXd> of_velocity) const;
  /// d g / d(y, y') there, 2n entries, of gap() or of force().
  void direction(int contact, bool of_force, Eigen::Ref<Eigen::VectorXd> by_x) const;

  /// After a free fly(): the impact of a contact, which stays closed then or not. x() and
  /// by_unknowns() are those behind it from then on.
  void strike(int contact, bool stays = false);
  /// 1 - epsilon of a contact, and what a velocity of its gap of 1 is in y', n entries.
  double lost_share(int contact) const;
  void along(int contact, Eigen::Ref<Eigen::VectorXd> y) const;
  /// An impact that comes later by dt leaves x() at the same instant off by this times dt.
  const Eigen::VectorXd& by_time() const { return by_time_; }
  /// What strike() makes of a deviation of x before it.
  void carry_through(Eigen::Ref<Eigen::VectorXd> dx) const;

 private:
  struct Variant {
    Machine machine;
    Eigen::VectorXd inputs;
    bool own_flow = false;              // C or K is not the centre's
    std::vector<OscillatorStep> steps;  // of the last free flight, where own_flow
    Eigen::VectorXd x;
    std::vector<std::complex<double>> harmonics;    // of each group, at the end of the flight
    std::vector<std::complex<double>> derivatives;  // scratch of a Taylor series
  };

  Variant& centre() { return variants_.front(); }
  const Variant& centre() const { return variants_.front(); }
  void set(const Eigen::VectorXd& values, Variant& variant) const;
  void find_steps(const Variant& variant, double tau, std::vector<OscillatorStep>& steps) const;
  void fly(const Eigen::Ref<const Eigen::VectorXd>& x, double t, double tau, Variant& variant);
  void add_steady(double sign, Variant& variant) const;
  void strike(int contact, bool stays, Variant& variant);
  void hold(int contact, double tau, Variant& variant);
  void hold_homogeneous(int contact, double tau);
  void add_held_terms(const Machine& machine, int contact, double share);
  // Of a mode: position, velocity, constant force, acceleration without contact forces.
  struct FreePart {
    double y = 0.0, u = 0.0, force = 0.0, acceleration = 0.0;
  };
  FreePart free_part(Eigen::Index i, const Variant& variant) const;
  Gap gap(int contact, const Variant& variant) const;
  Gap force(int contact, const Variant& variant) const;
  void difference();

  const MachineFamily* family_;
  std::vector<Variant> variants_;  // the centre; then two of each unknown, to either side
  bool derivatives_ = false;
  Eigen::VectorXd c_, values_;
  std::vector<OscillatorStep> steps_, turn_;
  Eigen::VectorXd x_, by_time_;
  Eigen::MatrixXd by_c_;
  double end_ = 0.0;  // of the flight [s]
  int held_ = -1;     // in that flight
  int struck_ = 0;
  bool stays_ = false;
  Eigen::MatrixXd held_step_;    // 2n x 2n
  Eigen::VectorXd term_, next_;  // of a Taylor series
};

}  // namespace sprag
