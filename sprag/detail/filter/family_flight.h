// Flight and impact of the machines that the unknowns of a scene span (family_machine.h),
//
//   y'' + C y' + K y = F(t) + D lambda,   w_i^T y'' + s_i'' = 0 for each held contact i,
//
// in x = (y, y') with the modes y of the nominal machine. With H the held contacts, the contact
// forces are lambda_H = -G_HH^-1 (W_H^T y''_free + s_H''), so that x' = A_H x + B_H i(t). The
// inputs i(t) are 1, cos and sin of each harmonic, and a(t) with three derivatives of each record,
// which are linear in themselves. A flight is the exponential of this linear system, from one knot
// of the records to the next. Free flight of uncoupled modes has a closed form.
//
// Derivatives by x are exact. Derivatives by the coordinates c of the unknowns are central
// differences, each between two machines of the family.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <limits>
#include <vector>

#include "sprag/detail/filter/family_machine.h"
#include "sprag/detail/filter/flight.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/input_cursor.h"
#include "sprag/detail/mechanics/matrix_exponential.h"
#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {

class FamilyFlight final : public Flight {
 public:
  /// Throws ModelError if M is not positive definite.
  FamilyFlight(const Scene& scene, std::vector<Parameter> unknowns);

  Eigen::Index n() const override { return family_.n(); }
  Eigen::Index unknowns() const override { return std::ssize(family_.unknowns()); }
  int contacts() const override { return family_.contacts(); }
  void set(const ConstVector& c, bool derivatives) override;
  bool can_hold(ContactSet held) const override { return independent(0, held) == held; }
  ContactSet independent(ContactSet first, ContactSet closed) const override;
  void fly(const ConstVector& x, double t, double tau, ContactSet held) override;
  void fly_on(double tau, ContactSet held) override;
  void carry(Columns dx) override;
  void carry_by_unknown(Eigen::Index k, Vector dx) override;
  bool changes_flow(Eigen::Index k) const override { return family_.changes_flow(k); }
  void turn(double tau, ContactSet held, Columns dx) override;
  double largest_frequency() const override;
  double smallest_frequency() const override;
  Gap gap(int contact) const override;
  double open_for() override { return 0.0; }
  Gap force(int contact) const override { return force(contact, centre()); }
  void gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  void acceleration_gradient(int contact, Vector of) const override;
  void differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  ContactSet strike(int contact, bool stays, ContactSet held, double sigma = 0.0) override;
  void carry_through(Columns dx) const override;
  /// Not supported and not needed: with uncertain parameters event times are never exact.
  bool strike_together(ContactSet, ContactSet, ContactSet, ContactSet, Vector, Columns,
                       Vector) override {
    return false;
  }
  const Eigen::VectorXd& by_time() const override { return by_time_; }
  void along(int contact, Vector dx) const override;
  double restitution(int contact) const override { return centre().machine.restitution[contact]; }
  double restitution(int contact, double gamma) const override {
    return at_impact(contact, gamma, 0.0, centre()).epsilon;
  }
  void enter(const ConstVector& q, const ConstVector& u, double t, Vector x) override;
  void state(const ConstVector& x, double t, Vector q, Vector u) override;
  const Eigen::MatrixXd& to_state() const override { return to_state_; }
  const Eigen::MatrixXd& from_state() const override { return from_state_; }
  double twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const override;

 private:
  // (x, i) -> x over a part of a flight, or x -> x.
  struct Transition {
    Eigen::MatrixXd Phi;  // 2n rows
    double tau = 0.0;
    ContactSet held = 0;
    bool known = false;
  };
  struct Variant {
    FamilyMachine machine;
    bool own_flow = false;           // C or K differs from the centre's
    bool moves_like_centre = false;  // FamilyMachine::moves_like()
    Eigen::VectorXd x;
    std::vector<std::complex<double>> harmonics;  // e^(i Omega t) at the end of the flight
    double harmonics_at = std::numeric_limits<double>::quiet_NaN();  // this t; NaN: unknown
    std::vector<InputDerivatives> recorded;                          // each record there
    // Of the last flight: in closed form; of its last part; of its parts from knot to knot; of all
    // of it, without inputs.
    std::vector<OscillatorStep> steps;
    Transition part, interval, whole;
  };
  // Impact of one contact: u+ = u- - change gamma- direction.
  struct Jump {
    Eigen::VectorXd direction;
    double change = 0.0;
    ContactSet staying = 0;
  };

  Variant& centre() { return variants_.front(); }
  const Variant& centre() const { return variants_.front(); }
  std::size_t used() const { return derivatives_ ? variants_.size() : 1; }
  bool in_closed_form(ContactSet held) const { return held == 0 && family_.uncoupled(); }
  Eigen::Index first_record() const;

  void start(double tau, ContactSet held);
  void fly(const ConstVector& x, double t, double tau, Variant& variant);
  template <class Move>
  void along_records(double t, double tau, Variant& variant, const Move& move);
  void set_phases(double t, Variant& variant) const;
  void add_steady(double sign, Variant& variant) const;
  void find_steps(const FamilyMachine& machine, double tau,
                  std::vector<OscillatorStep>& steps) const;
  void move_free(double part, const std::vector<OscillatorStep>& steps, Variant& variant) const;
  void move(double part, Transition& with, Variant& variant);
  void close(ContactSet held, Variant& variant) const;
  void close(ContactSet held, Columns dx) const;
  void find(const FamilyMachine& machine, double tau, ContactSet held, bool with_inputs,
            Transition& of);
  void set_generator(const FamilyMachine& machine, ContactSet held, bool with_inputs,
                     Eigen::Ref<Eigen::MatrixXd> A) const;
  const Eigen::MatrixXd& whole(Variant& variant);
  void apply(const std::vector<OscillatorStep>& steps, Columns dx) const;
  void apply(const Eigen::MatrixXd& Phi, ContactSet held, Columns dx) const;

  void add_forces(const FamilyMachine& machine, ContactSet held, const ContactVector& lambda,
                  Eigen::Ref<Eigen::VectorXd> u) const;
  void accelerate(const Variant& variant, ContactSet held, Eigen::VectorXd& a) const;
  double applied(Eigen::Index i, int order, const Variant& variant) const;
  Gap support(int contact, const Variant& variant) const;
  Gap gap(int contact, const Variant& variant) const;
  Gap force(int contact, const Variant& variant) const;
  ImpactRestitution at_impact(int contact, double gamma, double sigma,
                              const Variant& variant) const;
  void find_jump(int contact, double epsilon, bool ends_chatter, ContactSet others,
                 const Variant& variant, Jump& jump) const;
  void difference();

  FamilyOfMachines family_;
  std::vector<InputCursor> cursors_;
  std::vector<Variant> variants_;  // the centre; then two for each unknown, c_k +- difference_step
  bool derivatives_ = false;
  Eigen::VectorXd c_, values_;
  Eigen::VectorXd by_time_, stiffness_;
  Eigen::MatrixXd to_state_, from_state_;
  double end_ = 0.0, tau_ = 0.0;  // end and duration of the last flight [s]
  ContactSet held_ = 0;           // contacts held in it
  std::vector<OscillatorStep> turn_steps_;
  Transition turn_;
  MatrixExponential exponential_;
  Jump change_;  // derivative of the centre's impact by gamma-
  Jump jump_;
  int contact_ = 0;  // of strike()
  // Scratch.
  Eigen::MatrixXd generator_;
  Eigen::VectorXd scale_, inputs_;
  mutable Eigen::VectorXd a_, rate_, column_;
};

}  // namespace sprag
