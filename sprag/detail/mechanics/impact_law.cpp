#include "sprag/detail/mechanics/impact_law.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Pivots below this fraction of their diagonal entry mean linearly dependent directions.
constexpr double dependent_pivot = 1e-12;

constexpr int max_patience = 8;
constexpr int max_pivots = 1 << 16;
constexpr int max_exchanges = 1 << 10;

using Basis = std::array<bool, max_contacts>;

// Solves A_BB x_B = -b_B for the basic set by a Cholesky factorization without square roots.
Solved solve_basic(const ContactMatrix& A, const ContactVector& b, const Basis& basic,
                   ContactVector& x) {
  std::array<int, max_contacts> index{};
  int n = 0;
  for (int i = 0; i < b.size(); ++i) {
    if (basic[static_cast<std::size_t>(i)]) index[static_cast<std::size_t>(n++)] = i;
  }
  const auto at = [&](int k) { return index[static_cast<std::size_t>(k)]; };
  ContactMatrix L(n, n);
  ContactVector d(n);
  ContactVector r(n);
  for (int j = 0; j < n; ++j) {
    double pivot = A(at(j), at(j));
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k) * d[k];
    if (!(pivot > dependent_pivot * A(at(j), at(j)))) return Solved::dependent;
    d[j] = pivot;
    for (int i = j + 1; i < n; ++i) {
      double sum = A(at(i), at(j));
      for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k) * d[k];
      L(i, j) = sum / pivot;
    }
    r[j] = -b[at(j)];
    for (int k = 0; k < j; ++k) r[j] -= L(j, k) * r[k];
  }
  x.setZero();
  for (int j = n - 1; j >= 0; --j) {
    double sum = r[j] / d[j];
    for (int i = j + 1; i < n; ++i) sum -= L(i, j) * x[at(i)];
    x[at(j)] = sum;
  }
  return Solved::yes;
}

// Whether the distribution of the load on the basic set is not unique: a nonbasic row has y = 0 in
// a direction that depends on the basic rows.
bool is_guess(const ContactMatrix& A, const Basis& basic, const ContactVector& y,
              double tolerance) {
  Basis closed = basic;
  bool loaded = false;
  bool degenerate = false;
  for (int i = 0; i < y.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    loaded = loaded || basic[k];
    if (basic[k] || y[i] > tolerance) continue;
    closed[k] = degenerate = true;
  }
  if (!loaded || !degenerate) return false;
  ContactVector x(y.size());
  return solve_basic(A, y, closed, x) != Solved::yes;
}

}  // namespace

bool has_one_restitution(const Model& model) {
  if (model.contacts.size() == 1) return true;
  return std::all_of(model.contacts.begin(), model.contacts.end(), [&](const Contact& contact) {
    return contact.curve.is_constant() && contact.restitution == model.contacts.front().restitution;
  });
}

ContactSet independent_of(const Eigen::MatrixXd& G, ContactSet first, ContactSet rest) {
  // Cholesky factorization row by row. A row without a pivot is dropped.
  std::array<int, max_contacts> index{};
  ContactMatrix L(max_contacts, max_contacts);
  int n = 0;
  const auto add = [&](int contact) {
    double pivot = G(contact, contact);
    for (int j = 0; j < n; ++j) {
      double sum = G(contact, index[static_cast<std::size_t>(j)]);
      for (int l = 0; l < j; ++l) sum -= L(n, l) * L(j, l);
      L(n, j) = sum / L(j, j);
      pivot -= L(n, j) * L(n, j);
    }
    if (!(pivot > dependent_pivot * G(contact, contact))) return false;
    L(n, n) = std::sqrt(pivot);
    index[static_cast<std::size_t>(n++)] = contact;
    return true;
  };
  for_each(first, [&](int contact) { add(contact); });
  ContactSet independent = 0;
  for_each(rest & ~first, [&](int contact) {
    if (add(contact)) independent |= bit(contact);
  });
  return independent;
}

ContactMatrix of_contacts(const Eigen::Ref<const Eigen::MatrixXd>& G, ContactSet contacts) {
  const auto n = static_cast<Eigen::Index>(std::popcount(contacts));
  ContactMatrix G_S(n, n);
  Eigen::Index row = 0;
  for_each(contacts, [&](int i) {
    Eigen::Index column = 0;
    for_each(contacts, [&](int j) { G_S(row, column++) = G(i, j); });
    ++row;
  });
  return G_S;
}

Solved solve_lcp(const ContactMatrix& A, const ContactVector& b, ContactVector& x,
                 ContactVector& y) {
  const auto n = static_cast<int>(b.size());
  x.resize(n);
  y.resize(n);
  if (n == 0) return Solved::yes;
  if (n == 1) {
    if (!(A(0, 0) > 0.0)) return Solved::dependent;
    x[0] = b[0] < 0.0 ? -b[0] / A(0, 0) : 0.0;
    y[0] = b[0] < 0.0 ? 0.0 : b[0];
    return Solved::yes;
  }
  x.setZero();
  Basis basic{};
  const double tolerance = 8.0 * std::numeric_limits<double>::epsilon() * b.cwiseAbs().maxCoeff();
  // All violated indices change sides at once while their number falls within every max_patience
  // pivots (Judice & Pires 1994). Otherwise only the least index does (Murty), which is finite but
  // may take many pivots.
  int fewest = n + 1;
  int patience = max_patience;
  for (int pivot = 0; pivot < max_pivots; ++pivot) {
    Basis violated{};
    int violations = 0;
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      y[i] = basic[k] ? 0.0 : b[i] + A.row(i).dot(x);
      violated[k] = basic[k] ? x[i] < 0.0 : y[i] < -tolerance;
      violations += violated[k] ? 1 : 0;
    }
    if (violations == 0) {
      if (is_guess(A, basic, y, tolerance)) return Solved::dependent;
      y = y.cwiseMax(0.0);
      return Solved::yes;
    }
    if (violations < fewest) {
      fewest = violations;
      patience = max_patience;
    } else if (patience > 0) {
      --patience;
    }
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
      if (!violated[i]) continue;
      basic[i] = !basic[i];
      if (patience == 0) break;
    }
    if (solve_basic(A, b, basic, x) == Solved::yes) continue;
    // A large basic set may be dependent where smaller ones are not: start again by least index.
    if (patience == 0) return Solved::dependent;
    patience = 0;
    basic = {};
    x.setZero();
  }
  return Solved::dependent;
}

namespace {

// State of the active-set method of solve_semidefinite_lcp.
struct ActiveSet {
  const ContactMatrix& A;
  const ContactVector& b;
  ContactVector& x;
  Basis basic{};
  ContactVector target;  // solution of the basic rows

  int size() const { return static_cast<int>(b.size()); }

  // Row that enters the basic set: the one with the most negative y or, late, the one of least
  // index, since the steepest descent may cycle. -1 if there is none.
  int entering(const ContactVector& noise, ContactSet unsatisfied, bool steepest,
               ContactVector& y) const {
    y = b + A * x;
    int found = -1;
    for (int i = 0; i < size(); ++i) {
      const double tolerance = 16.0 * std::numeric_limits<double>::epsilon() *
                               (std::abs(b[i]) + A.row(i).cwiseAbs().dot(x));
      if (basic[index(i)]) {
        y[i] = 0.0;
      } else if (!contains(unsatisfied, i) && y[i] < -std::max(tolerance, noise[i]) &&
                 (found < 0 || (steepest && y[i] < y[found]))) {
        found = i;
      }
    }
    return found;
  }

  // Replaces a basic row by the entering row, which depends on the basic ones. Sets `blocked` to
  // false if no x satisfies the entering row.
  Solved replace(int entering, bool& blocked) {
    basic[index(entering)] = false;
    ContactVector column = A.col(entering);
    if (solve_basic(A, column, basic, target) != Solved::yes) return Solved::dependent;
    int leaving = -1;
    double length = std::numeric_limits<double>::infinity();
    for (int i = 0; i < size(); ++i) {
      if (!basic[index(i)] || !(target[i] < 0.0) || !(x[i] / -target[i] < length)) continue;
      length = x[i] / -target[i];
      leaving = i;
    }
    blocked = leaving >= 0;
    if (!blocked) return Solved::yes;
    x += length * target;
    x[entering] = length;
    x[leaving] = 0.0;
    basic[index(leaving)] = false;
    basic[index(entering)] = true;
    return solve_basic(A, b, basic, target);
  }

  // Moves x to the target. A basic row whose x falls to zero on the way leaves the basic set.
  Solved move_to_target() {
    for (int exchange = 0; exchange < size(); ++exchange) {
      double length = 1.0;
      for (int i = 0; i < size(); ++i) {
        if (basic[index(i)] && target[i] <= 0.0) {
          length = std::min(length, x[i] / (x[i] - target[i]));
        }
      }
      if (length == 1.0) break;
      for (int i = 0; i < size(); ++i) {
        if (!basic[index(i)]) continue;
        const bool leaves = target[i] <= 0.0 && x[i] / (x[i] - target[i]) <= length;
        x[i] += length * (target[i] - x[i]);
        if (!leaves) continue;
        x[i] = 0.0;
        basic[index(i)] = false;
      }
      if (solve_basic(A, b, basic, target) != Solved::yes) return Solved::dependent;
    }
    x = target;
    return Solved::yes;
  }
};

}  // namespace

Solved solve_semidefinite_lcp(const ContactMatrix& A, const ContactVector& b,
                              const ContactVector& noise, ContactVector& x, ContactVector& y,
                              ContactSet& unsatisfied) {
  unsatisfied = 0;
  if (solve_lcp(A, b, x, y) == Solved::yes) return Solved::yes;
  // Active-set method for min x^T A x / 2 + b^T x, x >= 0 (Lawson & Hanson 1974, ch. 23). The basic
  // rows are always independent. An entering row that depends on them replaces one of them, along a
  // direction in which A x is constant. If no row blocks that direction, no x satisfies the
  // entering row.
  const auto n = static_cast<int>(b.size());
  x.setZero(n);
  ActiveSet set{A, b, x, {}, ContactVector(n)};
  for (int step = 0; step < max_exchanges; ++step) {
    const int entering = set.entering(noise, unsatisfied, step < max_exchanges / 2, y);
    if (entering < 0) {
      for (int i = 0; i < n; ++i) {
        if (!contains(unsatisfied, i)) y[i] = std::max(y[i], 0.0);
      }
      return Solved::yes;
    }
    set.basic[index(entering)] = true;
    if (solve_basic(A, b, set.basic, set.target) != Solved::yes) {
      bool blocked = true;
      if (set.replace(entering, blocked) != Solved::yes) return Solved::dependent;
      if (!blocked) {
        unsatisfied |= bit(entering);
        continue;
      }
    }
    if (set.move_to_target() != Solved::yes) return Solved::dependent;
  }
  return Solved::dependent;
}

Solved arrest(const ContactMatrix& G, const ContactVector& gamma, ContactVector& Lambda) {
  Basis all;
  all.fill(true);
  Lambda.resize(gamma.size());
  return solve_basic(G, gamma, all, Lambda);
}

namespace {

/// solve(A, b, x, y) is one of the two solvers above.
template <typename Solve>
Solved impact_by(const Solve& solve, ImpactLaw law, const ContactMatrix& G,
                 const ContactVector& epsilon, const ContactVector& gamma_minus,
                 ContactVector& Lambda, ContactVector& gamma_plus) {
  ContactVector y;
  if (law == ImpactLaw::newton) {
    const ContactVector b = gamma_minus + epsilon.cwiseProduct(gamma_minus);
    const Solved solved = solve(G, b, Lambda, y);
    if (solved == Solved::yes) gamma_plus = y - epsilon.cwiseProduct(gamma_minus);
    return solved;
  }
  ContactVector gamma_C;
  if (solve(G, gamma_minus, Lambda, gamma_C) != Solved::yes) return Solved::dependent;
  const ContactVector restitution = epsilon.cwiseProduct(Lambda);
  ContactVector b = gamma_C + G * restitution;
  ContactVector nu;
  const bool some_remains = (epsilon.array() < 0.0).any();
  ContactVector least;
  if (some_remains) {
    least = -epsilon.cwiseMin(0.0).cwiseProduct(gamma_minus.cwiseMin(0.0));
    b -= least;
  }
  const Solved solved = solve(G, b, nu, gamma_plus);
  if (some_remains) gamma_plus += least;
  Lambda += restitution + nu;
  return solved;
}

}  // namespace

Solved impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
              const ContactVector& gamma_minus, ContactVector& Lambda, ContactVector& gamma_plus) {
  return impact_by(solve_lcp, law, G, epsilon, gamma_minus, Lambda, gamma_plus);
}

Solved semidefinite_impact(ImpactLaw law, const ContactMatrix& G, const ContactVector& epsilon,
                           const ContactVector& gamma_minus, const ContactVector& noise,
                           ContactVector& Lambda, ContactVector& gamma_plus,
                           ContactSet& unsatisfied) {
  unsatisfied = 0;
  const auto solve = [&](const ContactMatrix& A, const ContactVector& b, ContactVector& x,
                         ContactVector& y) {
    ContactSet left_out = 0;
    const Solved solved = solve_semidefinite_lcp(A, b, noise, x, y, left_out);
    unsatisfied |= left_out;
    return solved;
  };
  return impact_by(solve, law, G, epsilon, gamma_minus, Lambda, gamma_plus);
}

}  // namespace sprag
