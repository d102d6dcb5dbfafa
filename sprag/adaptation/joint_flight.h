// Free flight and impact of the machines that the unknowns of a scene span (machine_family.h), with
// derivatives by the state and by the unknowns' coordinates c: those by the state in closed form,
// those by c by central differences, each between two machines of the family. In modal coordinates
// y of q = V y. Does not allocate once it is made.
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

  /// From (y, y') = x, 2n entries, at t to t + tau; tau may be negative.
  void fly(const Eigen::Ref<const Eigen::VectorXd>& x, double t, double tau);

  /// After fly(): (y, y') there, and d(y, y') / dc, 2n x P, where derivatives are wanted.
  const Eigen::VectorXd& x() const { return x_; }
  const Eigen::MatrixXd& by_unknowns() const { return by_c_; }
  /// d(y, y') / dx applied to a deviation of x, in place.
  void carry(Eigen::Ref<Eigen::VectorXd> dx) const;

  /// After fly(): gap of a contact there, its velocity and acceleration.
  struct Gap {
    double g = 0.0, velocity = 0.0, acceleration = 0.0;
    double terms = 0.0;  ///< sum of the absolute terms of g, those of the angle included
  };
  Gap gap(int contact) const;
  /// Its derivatives by the x that fly() began with and by c, (2n + P) entries.
  void gap_derivatives(int contact, Eigen::Ref<Eigen::VectorXd> by_z) const;

  /// After fly(): the impact of a contact. x() and by_unknowns() are those behind it from then on.
  void strike(int contact);
  /// An impact that comes later by dt leaves x() at the same instant off by this times dt.
  const Eigen::VectorXd& by_time() const { return by_time_; }
  /// What strike() makes of a deviation of x before it.
  void carry_through(Eigen::Ref<Eigen::VectorXd> dx) const;

 private:
  struct Variant {
    Machine machine;
    Eigen::VectorXd inputs;
    bool own_flow = false;  // C or K is not the centre's
    Eigen::VectorXd x;
    std::vector<std::complex<double>> harmonics;  // of each group, at the end of the flight
  };

  Variant& centre() { return variants_.front(); }
  const Variant& centre() const { return variants_.front(); }
  void set(const Eigen::VectorXd& values, Variant& variant) const;
  void find_steps(const Variant& variant, double tau, std::vector<OscillatorStep>& steps) const;
  void fly(const Eigen::Ref<const Eigen::VectorXd>& x, double t, double tau, Variant& variant);
  void add_steady(double sign, Variant& variant) const;
  void strike(int contact, Variant& variant);
  Gap gap(int contact, const Variant& variant) const;
  void difference();

  const MachineFamily* family_;
  std::vector<Variant> variants_;  // the centre; then two of each unknown, to either side
  bool derivatives_ = false;
  Eigen::VectorXd c_, values_;
  std::vector<OscillatorStep> steps_, own_steps_;
  Eigen::VectorXd x_, by_time_;
  Eigen::MatrixXd by_c_;
  double end_ = 0.0;  // of the flight [s]
  int struck_ = 0;
};

}  // namespace sprag
