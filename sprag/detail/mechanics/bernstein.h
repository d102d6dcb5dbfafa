// Polynomials of degree 7 on [0, 1] in Bernstein form, p(s) = sum_i b_i C(7, i) s^i (1 - s)^(7-i).
//
// The graph of p lies in the convex hull of the control points (i / 7, b_i) (Farin, Curves and
// Surfaces for CAGD, ch. 4-5). So p has no root if all b_i have one sign, and no root before the
// point where the hull first meets zero. No function here allocates.
#pragma once

#include <array>

namespace sprag::bernstein {

inline constexpr int degree = 7;

/// a_j of sum_j a_j s^j, or b_i of the Bernstein form.
using Coefficients = std::array<double, degree + 1>;

/// Bernstein coefficients of a polynomial with these power coefficients.
Coefficients from_power(const Coefficients& a);

/// The part of a polynomial on [low, low + length] of [0, 1]; b is its Bernstein form there.
struct Piece {
  Coefficients b;
  double low;
  double length;
};

/// Splits `piece` at the fraction s in (0, 1) of its length by de Casteljau's algorithm: `piece`
/// becomes the left part, `right` the right part.
void split(Piece& piece, double s, Piece& right);

/// Replaces `piece` by its part to the right of the fraction s of its length.
void cut(Piece& piece, double s);

/// The first s at which the convex hull of the control points meets zero, for b_0 > 0. The
/// polynomial has no root before s. Infinity if the hull does not meet zero.
double hull_crossing(const Coefficients& b);

/// Lower bound s of the first root in (0, 1] of a polynomial with b_0 > 0. The polynomial is
/// positive on (0, s), and at most b_0 / 100 at s unless the limit of 400 iterations is reached.
/// Infinity only if it is positive on all of (0, 1).
double first_root(const Coefficients& b);

}  // namespace sprag::bernstein
