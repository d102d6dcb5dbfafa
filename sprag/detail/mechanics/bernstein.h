// Polynomials of degree 7 on [0, 1] in Bernstein form, p(s) = sum_i b_i C(7, i) s^i (1 - s)^(7-i).
// The graph of p lies in the convex hull of the control points (i / 7, b_i), so that coefficients
// of one sign show p to have no root, and where the hull meets zero no root lies before (Farin,
// Curves and Surfaces for CAGD, ch. 4-5). Nothing here allocates.
#pragma once

#include <array>

namespace sprag::bernstein {

inline constexpr int degree = 7;

/// a_j of sum_j a_j s^j, or b_i of the Bernstein form.
using Coefficients = std::array<double, degree + 1>;

/// Bernstein coefficients of a polynomial with these power coefficients.
Coefficients from_power(const Coefficients& a);

/// A polynomial's part on [low, low + length] of [0, 1], where b is its Bernstein form.
struct Piece {
  Coefficients b;
  double low;
  double length;
};

/// Splits at the share s in (0, 1) of its length: `piece` becomes the left part, `right` the right
/// one (de Casteljau).
void split(Piece& piece, double s, Piece& right);

/// Leaves the right part alone.
void cut(Piece& piece, double s);

/// Where the convex hull of the control points, b_0 > 0, first meets zero: no root lies before.
/// Infinity if it does not meet it.
double hull_crossing(const Coefficients& b);

/// Lower bound of the first root in (0, 1] of a polynomial with b_0 > 0: it is positive before and,
/// unless 400 steps do not suffice, at most a hundredth of b_0 there. Infinity only where it is
/// positive on all of (0, 1).
double first_root(const Coefficients& b);

}  // namespace sprag::bernstein
