// The distance b between machine and replica with its terms of first order kept apart: not a number
// that only adds up, but a set that free flights and impacts rotate and shrink. The machine is at
//
//   x_m = x_s + e + sum_j theta_j xi_j + a rest of length b,   e in an ellipsoid, |theta_j| <= 1.
//
// e holds what event times and restitutions do (error_ellipsoid.h), xi_j what a constant factor
// on K or C does (parameter_pair.h), and b what is of second order, a force, and the start:
//
//   flight of length tau   b -> sigma(tau) b + int rho_2 dt + |B| |e| tau
//     rho_2 = sum_i |B_i m_i| + sum_ij |B_i xi_j| + eta / sqrt 2
//   impact, window +- delta of no other event, gamma < 0 for all of the set and the window:
//     e -> H e + s c + d n gamma^-,  |s| <= delta, |d| <= d_eps,   H = 1 - (1 + eps) n w^T,
//     c = (1 + eps) (gamma^- A n + gamma' n),
//     b -> b + delta^2 / 2 (sup |c'| + |A c|) + 2 delta (1 + eps) omega_gamma r
//            + d_eps (r_gamma + delta (omega_gamma g + a) |n|) + 4 delta sup |rho|
//
// with r the radius of e + sum theta_j xi_j, r_gamma |n| its largest gap velocity, g = sup gamma^-
// and a = sup |gamma'|. In the window the machine is taken as the nominal one, which costs the
// defect rho of first order (model_defect.h) of both paths, twice. Everywhere else (clusters,
// closings, openings, joint impacts) the set is given up for the one number (bound_tracker.h).
#pragma once

#include <optional>
#include <vector>

#include "sprag/detail/bound/error_ellipsoid.h"
#include "sprag/detail/bound/event_cost.h"
#include "sprag/detail/bound/model_defect.h"
#include "sprag/detail/bound/parameter_pair.h"

namespace sprag {

/// A reported impact of one contact with nothing else closed.
struct LoneImpact {
  int contact = 0;
  double epsilon = 0.0;
  double t = 0.0;
  Approach near;            ///< on the free branch through the replica
  double gamma = 0.0;       ///< just before it
  double gamma_rate = 0.0;  ///< the same
  double defect = 0.0;      ///< first-order defect of the replica's paths in the window, at most
  double shift = 0.0;       ///< what it adds to b as one number: D + E of event_cost.h
  double rounding = 0.0;
};

/// All lengths in sqrt of energy. Nothing but the constructor allocates.
class FirstOrderBound {
 public:
  /// Machines of more coordinates do without: an event costs O(f^3).
  static constexpr Eigen::Index most_coordinates = 16;

  /// Throws ModelError. `metric`, `defect` and `free` must outlive this.
  FirstOrderBound(const EnergyMetric& metric, const ModelDefect& defect, const Flow& free,
                  const Tolerance& tolerance);

  /// Few enough coordinates, and some deviation is kept apart.
  bool exists() const { return exists_; }
  bool active() const { return active_; }
  void stop() { active_ = false; }
  /// The set becomes the point 0 at t; q and u of the replica, f entries each.
  void start(double b, const Eigen::VectorXd& q, const Eigen::VectorXd& u, double t);

  /// The integral of rho_2 begins at t, or goes on to t in free flight; `replica` and `node` there.
  void look(const ModalState& replica, const DefectNode& node, double t);
  void step(const ModalState& replica, const DefectNode& node, double t);
  /// The bound on |x_m - x_s| at t, where the integral is, sigma the contraction since the last
  /// window or start.
  double distance(double sigma, double t) const;
  /// The part of it that is no set.
  double rest(double sigma, double t) const;
  /// Ends a flight at t: later contractions count from there.
  void settle(double sigma, double t);

  /// Moves the set to an impact at t; `replica` just before it.
  void arrive(const ModalState& replica, double t);
  /// After arrive(): the set through the impact, valid at the end of its window; false: some of the
  /// set may miss the contact, and the set is as it was.
  bool impact(const LoneImpact& impact, double D_factor, double E_factor);

 private:
  /// Of one pair at a point of the path.
  struct PairNode {
    double xi = 0.0, m = 0.0;  ///< |xi''|, |m''|
  };
  void add_shifts(const LoneImpact& impact, double D_factor, double E_factor);

  const EnergyMetric* metric_;
  const ModelDefect* defect_;
  Tolerance tolerance_;
  double in_;
  bool exists_ = false, active_ = false;
  std::optional<ErrorEllipsoid> ellipsoid_;
  std::vector<ParameterPair> pairs_;
  double b_ = 0.0, integral_ = 0.0;
  double since_ = 0.0;         // b and its contraction count from here
  double ellipsoid_t_ = 0.0;   // the ellipsoid is of this time
  double node_t_ = 0.0;        // of the rest
  double density_ = 0.0;       // rho_2
  double acceleration_ = 0.0;  // |x_s''|
  std::vector<PairNode> nodes_;
  double xi_ = 0.0, m_ = 0.0;  // sum |xi_j|, sum |m_j|
  Eigen::VectorXd c_, scratch_;
};

}  // namespace sprag
