// Flight of a machine from any state without impacts, and the next impact on it.
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
  /// `machine` must outlive this and must not move.
  FreeFlight(const Machine& machine, Eigen::VectorXd inputs);

  /// Moves the free part of the motion by tau.
  void move(double tau, Eigen::VectorXd& y, Eigen::VectorXd& u) const;
  /// The same from t on, with these contacts held.
  void move(ContactSet held, double t, double tau, Eigen::VectorXd& y, Eigen::VectorXd& u) const;
  double gap(int contact, const Eigen::VectorXd& y, double t) const;
  double gap_velocity(int contact, const Eigen::VectorXd& u, double t) const;
  /// Applies the impact of a contact to u; the contacts `staying` are held afterwards.
  void hit(int contact, double t, Eigen::VectorXd& u, ContactSet staying = 0) const;

  /// Inverts hit(): changes u after an impact to u before it. The restitution must not be zero.
  void undo_hit(int contact, double t, Eigen::VectorXd& u) const;

  /// Sampling interval, a fraction of the fastest vibration's period.
  double step() const { return step_; }

  /// The first impact after t and up to `until`, from the free part (y, u) of the motion at t. If
  /// `until` is before t: the last impact before t.
  std::optional<Impact> next_impact(Eigen::VectorXd y, Eigen::VectorXd u, double t,
                                    double until) const;

  /// The lowest sampled gap between t and `until`, of all contacts that are not held [m]; at most
  /// 0.
  double deepest(Eigen::VectorXd y, Eigen::VectorXd u, double t, double until,
                 ContactSet held = 0) const;

 private:
  const Machine& machine_;
  Eigen::VectorXd inputs_, constants_;
  double step_ = 0.0;
  mutable std::map<ContactSet, HeldFlight> held_;
};

/// Moves (y, u) along a path to just before impact k, through its passages. Calls visit(from, to,
/// held) before each part.
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

/// Contradictions between a stretch of a solution and its supports, beyond the uncertainty of its
/// path.
struct StretchPath {
  /// Deepest penetration between impacts, as the time it takes at the stretch's mean gap velocity
  /// [s].
  double inside = 0.0;
  double inside_from = 0.0, inside_to = 0.0;  ///< times of the impacts around it [s]
  bool hit_from_inside = false;  ///< an impact with an opening gap, at inside_to if `inside` is 0
  /// Largest uncertainty of a gap between impacts, five standard deviations, as the time it takes
  /// at the record's mean gap velocity [s].
  double unknown = 0.0;
};

/// Checks each stretch. `jitter` is that of the event times [s].
std::vector<StretchPath> check_paths(const MachineFamily& family, const Likelihood& solution,
                                     double jitter);

}  // namespace sprag
