// Impact laws of the closed contacts, eq. (6) of Baumann & Leine 2014 in its two common forms.
// gamma+ = gamma- + G Lambda with G = W^T M^-1 W, E = diag(epsilon):
//
//   generalized Poisson   compression  0 <= Lambda_C  _|_  gamma_C = gamma- + G Lambda_C >= 0
//                         expansion    gamma+ = gamma_C + G (E Lambda_C + nu),
//                                      0 <= nu _|_ gamma+ >= 0
//   generalized Newton    0 <= Lambda  _|_  gamma+ + E gamma- >= 0
//
// A replica's epsilon_i may be negative, down to -1 (model.h): then part of the approach velocity
// remains. Newton's law has the same form. In Poisson's expansion the condition becomes
// 0 <= nu _|_ gamma+ >= -E- min(gamma-, 0) with E- = min(E, 0), so a contact that does not approach
// before the impact does not approach after it. With one epsilon in [-1, 0] for all contacts, both
// laws are gamma+ = (1 + epsilon) P gamma- - epsilon gamma-, where P projects to the nearest point
// with gamma >= 0. This is a convex combination of P and the identity, so it is nonexpansive.
//
// The complementarity problems are solved by block principal pivoting, with Murty's least-index
// rule as the fallback, which is finite for positive definite G. The result is exact to rounding.
// Nothing here allocates.
#pragma once

#include <Eigen/Core>

#include "sprag/contact_event.h"
#include "sprag/model.h"

namespace sprag {

using ContactVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_contacts, 1>;
using ContactMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor,
                                    max_contacts, max_contacts>;

enum class Solved {
  yes,
  dependent  ///< G is singular within rounding: the contacts' directions are linearly dependent
};

/// Whether all contacts have the same restitution at all speeds. One contact has.
bool has_one_restitution(const Model& model);

/// Those of `rest` whose directions are linearly independent of those of `first`, which must be
/// independent, and of each other. Lower indices take precedence. G of all contacts, m x m.
ContactSet independent_of(const Eigen::MatrixXd& G, ContactSet first, ContactSet rest);

/// Rows and columns of G of these contacts, in ascending order.
ContactMatrix of_contacts(const Eigen::Ref<const Eigen::MatrixXd>& G, ContactSet contacts);

/// Solves 0 <= x _|_ y = A x + b >= 0, A symmetric positive definite (n x n, n <= max_contacts). If
/// the result is `dependent`, x and y are invalid. y is exactly zero where x is basic.
Solved solve_lcp(const ContactMatrix& A, const ContactVector& b, ContactVector& x,
                 ContactVector& y);

/// The same for positive semidefinite A, as with linearly dependent contact directions. Gives the
/// same x where solve_lcp has a solution. `noise` >= 0 is the rounding error of each entry of b:
/// y >= -noise counts as zero. y is unique; x is not. Here at most rank(A) entries of x are
/// positive, in independent rows. If no x >= 0 satisfies all rows, some are left out with x = 0 and
/// y < 0, and bit i of `unsatisfied` is set for row i. Returns Solved::dependent only if the
/// iteration does not end, which has not been observed.
Solved solve_semidefinite_lcp(const ContactMatrix& A, const ContactVector& b,
                              const ContactVector& noise, ContactVector& x, ContactVector& y,
                              ContactSet& unsatisfied);

/// Impulses Lambda [N s], of either sign, that bring the gap velocities gamma of n contacts to
/// zero: G Lambda = -gamma.
Solved arrest(const ContactMatrix& G, const ContactVector& gamma, ContactVector& Lambda);

/// Impulses Lambda [N s] and post-impact gap velocities gamma_plus of n contacts that are closed at
/// one instant; epsilon in [-1, 1]^n.
Solved impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
              const ContactVector& gamma_minus, ContactVector& Lambda, ContactVector& gamma_plus);

/// The same for possibly dependent directions: an independent subset takes the impulses. A contact
/// that cannot be satisfied ends with gamma+ < 0 and is in `unsatisfied`. `noise` is the rounding
/// error of gamma-; both as in solve_semidefinite_lcp.
Solved semidefinite_impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
                           const ContactVector& gamma_minus, const ContactVector& noise,
                           ContactVector& Lambda, ContactVector& gamma_plus,
                           ContactSet& unsatisfied);

}  // namespace sprag
