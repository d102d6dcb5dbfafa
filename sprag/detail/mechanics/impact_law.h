// Impact laws of the closed contacts, eq. (6) of Baumann & Leine 2014 in its two common forms.
// gamma+ = gamma- + G Lambda with G = W^T M^-1 W, E = diag(epsilon):
//
//   generalized Poisson   compression  0 <= Lambda_C  _|_  gamma_C = gamma- + G Lambda_C >= 0
//                         expansion    gamma+ = gamma_C + G (E Lambda_C + nu),  0 <= nu _|_ gamma+
//                         >= 0
//   generalized Newton    0 <= Lambda  _|_  gamma+ + E gamma- >= 0
//
// A replica's epsilon_i may be negative, down to -1 (model.h): not all of the approach is taken
// away. Newton's law is the same then; Poisson's expansion takes away no more than that,
// 0 <= nu _|_ gamma+ >= -E- min(gamma-, 0) with E- = min(E, 0). What is not approaching does not
// begin to. With one epsilon in [-1, 0] for all, both are (1 + epsilon) P gamma - epsilon gamma, P
// the nearest point with gamma >= 0: a mean of P and nothing, which expands no distance.
//
// The complementarity problems are solved by principal pivoting, block-wise, with Murty's
// least-index rule, which is finite for positive definite G, behind it: exact to rounding. Nothing
// here allocates.
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

/// Those of `rest` whose directions do not depend on those of `first`, which must be independent,
/// and of each other; the lower index goes first. G of all contacts, m x m.
ContactSet independent_of(const Eigen::MatrixXd& G, ContactSet first, ContactSet rest);

/// Rows and columns of G that belong to these contacts, in their order.
ContactMatrix of_contacts(const Eigen::Ref<const Eigen::MatrixXd>& G, ContactSet contacts);

/// 0 <= x _|_ y = A x + b >= 0, A symmetric positive definite (n x n, n <= max_contacts). On
/// `dependent` x is meaningless. y is exactly zero where x is basic.
Solved solve_lcp(const ContactMatrix& A, const ContactVector& b, ContactVector& x,
                 ContactVector& y);

/// The same for A positive semidefinite, as of contacts whose directions depend on each other; the
/// same x where solve_lcp has one. `noise` >= 0 is the rounding of b, row by row: y >= -noise
/// counts as zero. y is unique, x is not: at most rank(A) entries are positive here, those of rows
/// that are independent. Where no x >= 0 satisfies all rows, some are left out, with x = 0 and
/// y < 0: bit i of `unsatisfied` for row i. Solved::dependent only if it does not come to an end
/// (not seen to happen).
Solved solve_semidefinite_lcp(const ContactMatrix& A, const ContactVector& b,
                              const ContactVector& noise, ContactVector& x, ContactVector& y,
                              ContactSet& unsatisfied);

/// Impulses Lambda [N s], of either sign, that take the gap velocities gamma of n contacts to zero:
/// G Lambda = -gamma.
Solved arrest(const ContactMatrix& G, const ContactVector& gamma, ContactVector& Lambda);

/// Impulses Lambda [N s] and post-impact gap velocities gamma_plus of n contacts that are closed at
/// one instant; epsilon in [-1, 1]^n.
Solved impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
              const ContactVector& gamma_minus, ContactVector& Lambda, ContactVector& gamma_plus);

/// The same where directions may depend on each other: independent ones take the impulses. What
/// cannot be satisfied ends with gamma+ < 0 and is in `unsatisfied`; that and `noise`, the rounding
/// of gamma-, as of solve_semidefinite_lcp.
Solved semidefinite_impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
                           const ContactVector& gamma_minus, const ContactVector& noise,
                           ContactVector& Lambda, ContactVector& gamma_plus,
                           ContactSet& unsatisfied);

}  // namespace sprag
