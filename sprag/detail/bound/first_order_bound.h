// Distance between machine and replica with its first-order terms in a set that free flights and
// impacts rotate and contract, instead of a sum of norms. The machine is at
//
//   x_m = x_s + e + sum_j theta_j xi_j + a rest of length b,   e in an ellipsoid, |theta_j| <= 1.
//
// e contains the effect of event times and restitutions (error_ellipsoid.h), xi_j that of a
// constant factor on K or C (parameter_pair.h), and b the second-order terms, force and start:
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
// and a = sup |gamma'|. In the window the machine is replaced by the nominal one, which adds the
// first-order defect rho (model_defect.h) of both paths, twice. All other events (clusters,
// closings, openings, joint impacts) end the set; its bound is then a single number
// (bound_tracker.h).
#pragma once

#include <optional>
#include <vector>

#include "sprag/detail/bound/error_ellipsoid.h"
#include "sprag/detail/bound/event_cost.h"
#include "sprag/detail/bound/model_defect.h"
#include "sprag/detail/bound/parameter_pair.h"

namespace sprag {

/// A reported impact of one contact with no other closed.
struct LoneImpact {
  int contact = 0;
  double epsilon = 0.0;
  double t = 0.0;
  Approach near;            ///< on the free branch through the replica
  double gamma = 0.0;       ///< just before it
  double gamma_rate = 0.0;  ///< gamma' just before it
  double defect = 0.0;  ///< bound on the first-order defect of the replica's paths in the window
  double shift = 0.0;   ///< D + E of event_cost.h
  double rounding = 0.0;
};

/// All lengths in sqrt of energy. Only the constructor allocates.
class FirstOrderBound {
 public:
  /// Machines with more coordinates do not use it: an event costs O(f^3).
  static constexpr Eigen::Index most_coordinates = 16;

  /// Throws ModelError. `metric`, `defect` and `free` must outlive this.
  FirstOrderBound(const EnergyMetric& metric, const ModelDefect& defect, const Flow& free,
                  const Tolerance& tolerance);

  /// Whether the machine has few enough coordinates and some tolerance has first-order terms.
  bool exists() const { return exists_; }
  bool active() const { return active_; }
  void stop() { active_ = false; }
  /// Starts with the point 0 and the rest b at t; q and u of the replica, f entries each.
  void start(double b, const Eigen::VectorXd& q, const Eigen::VectorXd& u, double t);

  /// Starts the integral of rho_2 at t (look), or continues it to t in free flight (step);
  /// `replica` and `node` at t.
  void look(const ModalState& replica, const DefectNode& node, double t);
  void step(const ModalState& replica, const DefectNode& node, double t);
  /// Bound on |x_m - x_s| at t, the end of the integral; sigma: contraction since the last window
  /// or start.
  double distance(double sigma, double t) const;
  /// Part of distance() outside of the set.
  double rest(double sigma, double t) const;
  /// Ends a flight at t; later contractions count from t.
  void settle(double sigma, double t);

  /// Moves the set to an impact at t; `replica` just before it.
  void arrive(const ModalState& replica, double t);
  /// After arrive(): maps the set through the impact to the end of its window. Returns false and
  /// leaves the set unchanged if some state of it may miss the contact.
  bool impact(const LoneImpact& impact, double D_factor, double E_factor);

 private:
  /// Norms of one pair at a point of the path.
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
  double since_ = 0.0;         // start time of b and of its contraction
  double ellipsoid_t_ = 0.0;   // time of the ellipsoid
  double node_t_ = 0.0;        // time of the other members
  double density_ = 0.0;       // rho_2
  double acceleration_ = 0.0;  // |x_s''|
  std::vector<PairNode> nodes_;
  double xi_ = 0.0, m_ = 0.0;  // sum |xi_j|, sum |m_j|
  Eigen::VectorXd c_, scratch_;
};

}  // namespace sprag
