// Terms that one reported event can add to the error of a replica, in sqrt of energy: an impact, a
// closing or an opening that happened up to delta earlier or later than reported.
//
// Let Z be the map of the event (impact, closing or opening of the clutch) and F the flows before
// and after it. If the event moves in time, the end state moves by c = F(Z y) - DZ F(y) at most,
// evaluated on the replica's own path y, which is known. n = M^-1 w / G is the direction of the
// contact, |n| = 1 / sqrt(2 G), gamma the replica's gap velocity. For one contact with no other
// contact closed, in units of 1 / sqrt(2 G):
//
//   impact   D = delta (1 + eps) hypot(w_R g, a + w_D g),   J = (1 + eps + d_eps) g
//   closes   D = delta hypot(w_R g, a+ + w_D g),            J = g
//   opens    D = delta sup (gamma'_free)^-,                 J = 0
//
// and E = d_eps g of an impact; g = sup gamma^-, a = sup |gamma'| over the window of +- delta,
// widened by the path's distance rho from the replica inside a cluster. Else (several contacts at
// once, or others closed) the path's own speed bounds D, and projections are used: Poisson's law
// with one epsilon is (1 + eps) P - eps, P the nearest point with gamma >= 0.
#pragma once

#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/bound/signal_range.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/scene.h"

namespace sprag {

/// sqrt of energy each.
struct EventCost {
  double D = 0.0;  ///< time error; permanent
  double J = 0.0;  ///< only one of machine and replica has had the event; in the window only
  double E = 0.0;  ///< restitution error; permanent
};

/// Ranges of a contact's gap velocity and acceleration in an event's window, on the free branch
/// through the replica's state just before the event.
struct Approach {
  double fastest = 0.0;  ///< sup gamma^-
  double slowest = 0.0;  ///< inf gamma
  double highest = 0.0;  ///< sup gamma
  double rate = 0.0;     ///< sup |gamma'|
  double rate_up = 0.0;  ///< sup of gamma' > 0
  double second = 0.0;   ///< sup |gamma''|
};

/// \param free motion of free flight at the event; \param delta half the window [s].
Approach approach(const Motion& free, int contact, double delta);

enum class SingleEvent { impact, closes };

/// Cost of an impact or a closing of one contact with no other closed. `rho`: distance of the path
/// from the replica, sqrt of energy; `epsilon`: largest_change() of the contact.
EventCost single_cost(const EnergyMetric& metric, const Tolerance& tolerance, SingleEvent kind,
                      int contact, double epsilon, const Approach& approach, double rho);

/// An opening with nothing else closed. \param free_acceleration gamma' without the contact's force
/// at the event, \param speed the larger |x'| of the branches through it.
EventCost opening_cost(const EnergyMetric& metric, const Tolerance& tolerance, int contact,
                       double free_acceleration, double speed, double rho);

/// Distance, in sqrt of energy, from a state to the nearest state with gamma >= 0 in `contacts`;
/// gap velocities in ascending order of contacts. Infinity if the directions are linearly
/// dependent.
double distance_to_rest(const Eigen::MatrixXd& G, ContactSet contacts, const ContactVector& gamma);

/// Largest epsilon or |d(epsilon v)/dv| of the contacts; 0 without contacts.
double largest_change(const Model& model);

/// \brief Largest factor by which an impact of these contacts expands the distance of two states,
/// under Newton's or Poisson's law with any restitutions up to `epsilon`; >= 1.
///
/// On each of its linear pieces, with the contacts A active, the impact is the identity on the
/// states that leave gamma_A alone and similar to L^-1 E L on the others, G_A = L L^T and E the
/// restitutions. E commutes with the scaling of G to a unit diagonal, so that this is at most
/// epsilon times the root of the scaled matrix's condition number. Infinite where directions depend
/// on each other.
double joint_expansion(const Eigen::MatrixXd& G, ContactSet contacts, double epsilon);

/// Root of that condition number.
double contact_coupling(const Eigen::MatrixXd& G, ContactSet contacts);

/// Effect of restitution errors on an impulse of several contacts, relative to its length and per
/// unit of restitution: sup of sum Lambda_i sqrt(G_ii) / |Lambda|_G.
double restitution_spread(const Eigen::MatrixXd& G, ContactSet contacts);

}  // namespace sprag
