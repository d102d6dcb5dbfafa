// A machine that flies from any state, hit by nothing, and what it meets next.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "sprag/detail/identification/held_flight.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"

namespace sprag {

class FreeFlight {
 public:
  /// `machine` must stay in place.
  FreeFlight(const Machine& machine, Eigen::VectorXd inputs);

  /// Moves the free part of the motion by tau.
  void move(double tau, Eigen::VectorXd& y, Eigen::VectorXd& u) const;
  /// The same from t on, while these contacts are held.
  void move(ContactSet held, double t, double tau, Eigen::VectorXd& y, Eigen::VectorXd& u) const;
  double gap(int contact, const Eigen::VectorXd& y, double t) const;
  double gap_velocity(int contact, const Eigen::VectorXd& u, double t) const;
  /// The impact of a contact, those of `staying` being held from then on: changes u.
  void hit(int contact, double t, Eigen::VectorXd& u, ContactSet staying = 0) const;

  /// Changes u behind an impact to that before it; its restitution is not zero.
  void undo_hit(int contact, double t, Eigen::VectorXd& u) const;

  /// A fraction of the fastest vibration's period.
  double step() const { return step_; }

  /// The first impact after t and up to `until`, (y, u) being the free part of the motion at t; or,
  /// where `until` is before t, the last one before t.
  std::optional<Impact> next_impact(Eigen::VectorXd y, Eigen::VectorXd u, double t,
                                    double until) const;

  /// The lowest gap between t and `until`, at samples, of all contacts but those that are held
  /// meanwhile [m]; at most 0.
  double deepest(Eigen::VectorXd y, Eigen::VectorXd u, double t, double until,
                 ContactSet held = 0) const;

 private:
  const Machine& machine_;
  Eigen::VectorXd inputs_, constants_;
  double step_ = 0.0;
  mutable std::map<ContactSet, HeldFlight> held_;
};

/// Moves (y, u) along a path to impact k, before it is hit, through what happens on the way:
/// visit(from, to, held) before each part of it.
template <typename Visit>
void fly(const FreeFlight& flight, const Stretch& path, std::size_t k, Eigen::VectorXd& y,
         Eigen::VectorXd& u, Visit visit) {
  for_each_leg(path, k, [&](double from, double to, ContactSet held, const Passage* passage) {
    visit(from, to, held);
    flight.move(held, from, to - from, y, u);
    if (passage == nullptr || passage->contact < 0) return;
    flight.hit(passage->contact, to, u, passage->staying);
  });
}

/// What is wrong with a stretch of a solution, beyond what its times leave unknown of its path.
struct StretchPath {
  /// How long, at the usual gap velocity, contacts are inside their supports between impacts [s].
  double inside = 0.0;
  double inside_from = 0.0, inside_to = 0.0;  ///< the impacts between which that is [s]
  bool hit_from_inside = false;  ///< an impact whose gap rises; at inside_to, if `inside` is 0
  /// What is unknown of gaps between impacts at most, five standard deviations of the start's, at
  /// the record's usual gap velocity [s].
  double unknown = 0.0;
};

/// Of each stretch; event times jitter by `jitter` [s].
std::vector<StretchPath> check_paths(const MachineFamily& family, const Likelihood& solution,
                                     double jitter);

}  // namespace sprag
