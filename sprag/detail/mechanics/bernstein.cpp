#include "sprag/detail/mechanics/bernstein.h"

#include <algorithm>
#include <cstddef>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag::bernstein {
namespace {

constexpr std::size_t top = index(degree);

constexpr Coefficients inverses = [] {
  Coefficients values{};
  for (int j = 1; j <= degree; ++j) values[index(j)] = 1.0 / j;
  return values;
}();

// C(i, j) / C(degree, j) in row j: the contribution of power coefficient a_j = 1 to all Bernstein
// coefficients.
constexpr auto shares = [] {
  std::array<Coefficients, degree + 1> table{};
  const auto binomial = [](int n, int k) {
    double value = 1.0;
    for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
    return value;
  };
  for (int j = 0; j <= degree; ++j) {
    for (int i = j; i <= degree; ++i) {
      table[index(j)][index(i)] = binomial(i, j) / binomial(degree, j);
    }
  }
  return table;
}();

}  // namespace

Coefficients from_power(const Coefficients& a) {
  Coefficients b{};
  for (std::size_t j = 0; j <= top; ++j) {
    for (std::size_t i = 0; i <= top; ++i) b[i] += shares[j][i] * a[j];
  }
  return b;
}

void split(Piece& piece, double s, Piece& right) {
  right.b = piece.b;
  for (std::size_t level = 1; level <= top; ++level) {
    for (std::size_t i = top; i >= level; --i) {
      piece.b[i] = piece.b[i - 1] + s * (piece.b[i] - piece.b[i - 1]);
    }
    right.b[top - level] = piece.b[top];
  }
  right.low = piece.low + s * piece.length;
  right.length = (1.0 - s) * piece.length;
  piece.length *= s;
}

void cut(Piece& piece, double s) {
  for (std::size_t level = top; level >= 1; --level) {
    for (std::size_t i = 0; i < level; ++i) piece.b[i] += s * (piece.b[i + 1] - piece.b[i]);
  }
  piece.low += s * piece.length;
  piece.length *= 1.0 - s;
}

// Follows the lower edge of the hull from control point 0.
double hull_crossing(const Coefficients& b) {
  std::size_t i = 0;
  while (i < top) {
    std::size_t next = top;
    double steepest = infinity;
    for (std::size_t j = i + 1; j <= top; ++j) {
      const double slope = (b[j] - b[i]) * inverses[j - i];
      if (slope <= steepest) {
        steepest = slope;
        next = j;
      }
    }
    if (steepest >= 0.0) return infinity;
    if (b[next] < 0.0) return (static_cast<double>(i) - b[i] / steepest) / degree;
    i = next;
  }
  return infinity;
}

double first_root(const Coefficients& b) {
  constexpr int max_depth = 40;
  std::array<Piece, max_depth> later;
  int depth = 0;
  const double tolerance = 1e-2 * b[0];
  Piece piece{b, 0.0, 1.0};
  for (int iteration = 0; iteration < 400; ++iteration) {
    const double s = hull_crossing(piece.b);
    if (s > 1.0) {  // no root in this piece
      if (depth == 0) return infinity;
      piece = later[index(--depth)];
      if (piece.b[0] <= tolerance) return piece.low;
      continue;
    }
    if (s > 0.25 || depth == max_depth) {
      if (s >= 1.0) return piece.low + piece.length;
      cut(piece, s);
      if (piece.b[0] <= tolerance) return piece.low;
    } else {
      // The factor 4 alone is not enough: if b_0 is just above zero, s is tiny whatever the root
      // is.
      split(piece, std::clamp(4.0 * s, 0.03125, 0.5), later[index(depth++)]);
    }
    if (piece.length < 1e-15 * piece.low) return piece.low;
  }
  return piece.low;
}

}  // namespace sprag::bernstein
