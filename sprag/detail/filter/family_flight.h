// Flight and impact of the machines that the unknowns of a scene span (machine_family.h), free or
// with one contact closed,
//
//   y'' + C y' + K y = F(t) + w lambda,   w^T y'' + s'' = 0 while it is closed,
//
// in x = (y, y') with the modal coordinates y of q = V y. Derivatives by x are in closed form.
// Derivatives by the coordinates c of the unknowns are central differences, each between two
// machines of the family.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "sprag/detail/filter/flight.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/mechanics/input_cursor.h"
#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {

class FamilyFlight final : public Flight {
 public:
  /// The family must be modal and must outlive this.
  explicit FamilyFlight(const MachineFamily& family);

  Eigen::Index n() const override { return family_->n(); }
  Eigen::Index unknowns() const override { return std::ssize(family_->unknowns()); }
  int contacts() const override { return family_->contacts(); }
  void set(const ConstVector& c, bool derivatives) override;
  /// At most one contact, for a limited duration: a flight with a closed contact is a Taylor
  /// series, in steps in which no angle turns by more than 1.
  bool can_hold(ContactSet held, double duration) const override;
  ContactSet independent(ContactSet first, ContactSet closed) const override;
  void fly(const ConstVector& x, double t, double tau, ContactSet held) override;
  void fly_on(double tau, ContactSet held) override;
  void carry(Columns dx) override;
  void carry_by_unknown(Eigen::Index k, Vector dx) const override;
  bool changes_flow(Eigen::Index k) const override {
    return variants_[static_cast<std::size_t>(1 + 2 * k)].own_flow;
  }
  void turn(double tau, ContactSet held, Columns dx) override;
  double largest_frequency() const override;
  double smallest_frequency() const override;
  Gap gap(int contact) const override { return gap(contact, centre()); }
  double open_for() override { return 0.0; }
  /// g is w^T w lambda.
  Gap force(int contact) const override { return force(contact, centre()); }
  void gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  void acceleration_gradient(int, Vector of) const override { of.setZero(); }
  void differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  bool can_strike(int contact, ContactSet held) const override {
    return (held & ~bit(contact)) == 0;
  }
  ContactSet strike(int contact, bool stays, ContactSet held) override;
  void carry_through(Columns dx) const override;
  /// Not supported and not needed: with uncertain parameters event times are never exact.
  bool strike_together(ContactSet, ContactSet, ContactSet, ContactSet, Vector, Columns,
                       Vector) override {
    return false;
  }
  const Eigen::VectorXd& by_time() const override { return by_time_; }
  void along(int contact, Vector dx) const override;
  double restitution(int contact) const override;
  void enter(const ConstVector& q, const ConstVector& u, double t, Vector x) override;
  void state(const ConstVector& x, double t, Vector q, Vector u) override;
  const Eigen::MatrixXd& to_state() const override { return to_state_; }
  const Eigen::MatrixXd& from_state() const override { return from_state_; }
  double twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const override;

 private:
  struct Variant {
    Machine machine;
    Eigen::VectorXd inputs;
    bool own_flow = false;              // C or K differs from the centre's
    std::vector<OscillatorStep> steps;  // of the last free flight, if own_flow
    Eigen::VectorXd x;
    std::vector<std::complex<double>>
        harmonics;  // exp(i Omega t) of each group, at the end of the flight
    std::vector<std::complex<double>> derivatives;  // scratch of a Taylor series
    std::vector<InputDerivatives> recorded;         // each record, at the end of the flight
  };

  Variant& centre() { return variants_.front(); }
  const Variant& centre() const { return variants_.front(); }
  void set_machine(const Eigen::VectorXd& values, Variant& variant) const;
  void find_steps(const Variant& variant, double tau, std::vector<OscillatorStep>& steps) const;
  void fly(const ConstVector& x, double t, double tau, Variant& variant);
  // Calls move(part) for each part of a flight from t by tau in which every record is a polynomial.
  // variant.recorded is that at the start of the part.
  template <class Move>
  void along_records(double t, double tau, Variant& variant, const Move& move);
  // Moves the free part of variant.x by a part of a flight.
  void move_free(double part, const std::vector<OscillatorStep>& steps, Variant& variant) const;
  double constant_force(Eigen::Index i, const Variant& variant) const;
  void add_steady(double sign, Variant& variant) const;
  void strike(int contact, bool stays, Variant& variant);
  void hold(int contact, double tau, Variant& variant);
  double steps_of_holding(double tau) const;
  void hold_homogeneous(int contact, double tau);
  void move(double tau, int held);
  void add_held_terms(const Machine& machine, int contact, double share);
  void add_held_inputs(int contact, int order, double share, double power, Variant& variant);
  // Free part of a mode: position, velocity, constant force, acceleration without contact forces.
  struct FreePart {
    double y = 0.0, u = 0.0, force = 0.0, acceleration = 0.0;
  };
  FreePart free_part(Eigen::Index i, const Variant& variant) const;
  Gap gap(int contact, const Variant& variant) const;
  Gap force(int contact, const Variant& variant) const;
  void difference();

  const MachineFamily* family_;
  std::vector<InputCursor> cursors_;
  std::vector<Variant> variants_;  // the centre; then two for each unknown, c_k +- difference_of_c
  bool derivatives_ = false;
  Eigen::VectorXd c_, values_;
  std::vector<OscillatorStep> steps_, turn_;
  Eigen::VectorXd by_time_, stiffness_;
  Eigen::MatrixXd to_state_, from_state_;
  double end_ = 0.0;  // end of the flight [s]
  int held_ = -1;     // contact held in that flight, -1: none
  int struck_ = 0;
  bool stays_ = false;
  Eigen::MatrixXd held_step_;    // 2n x 2n
  Eigen::VectorXd term_, next_;  // scratch of the Taylor series
};

}  // namespace sprag
