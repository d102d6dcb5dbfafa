#include "mechanics/event_search.h"

#include <array>
#include <cmath>
#include <limits>

namespace sprag {
namespace {

constexpr int degree = 8;
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double infinity = std::numeric_limits<double>::infinity();

// A remainder of this share of the signal still lets the polynomial decide.
constexpr double remainder_share = 0.125;
// Two events closer than this (times 1 + t) are one.
constexpr double simultaneous = 1e-13;

using Coefficients = std::array<double, degree + 1>;

constexpr std::array<double, degree + 3> inverse_factorials = [] {
  std::array<double, degree + 3> values{};
  double factorial = 1.0;
  for (int j = 0; j < degree + 3; ++j) {
    values[static_cast<std::size_t>(j)] = 1.0 / factorial;
    factorial *= j + 1;
  }
  return values;
}();

// C(i, j) / C(n, j): from power coefficients on [0, 1] to Bernstein coefficients of degree n.
constexpr auto bernstein = [] {
  std::array<std::array<std::array<double, degree + 1>, degree + 1>, degree + 1> table{};
  const auto binomial = [](int n, int k) {
    double value = 1.0;
    for (int i = 1; i <= k; ++i) value = value * (n - k + i) / i;
    return value;
  };
  for (int n = 0; n <= degree; ++n) {
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; j <= i; ++j) {
        table[static_cast<std::size_t>(n)][static_cast<std::size_t>(i)]
             [static_cast<std::size_t>(j)] = binomial(i, j) / binomial(n, j);
      }
    }
  }
  return table;
}();

struct Expansion {
  Coefficients a{};    // phi^(j) / j!
  double bound = 0.0;  // of |phi^(p+1)| / (p+1)! from now on
  double noise = 0.0;  // rounding of a[0]
};

// First `count` oscillators only.
Expansion expand_signal(const Signal& signal, double sign, double constant,
                        const Oscillators& oscillators, const OscillatorState& x,
                        const Eigen::ArrayXd& alpha, Eigen::Index count) {
  Expansion e;
  Coefficients d{};
  double bound = 0.0;
  double magnitude = std::abs(constant);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double p = sign * signal.p[k];
    const double r = sign * signal.r[k];
    const double damping = 2.0 * oscillators.delta()[k];
    const double kappa = oscillators.kappa()[k];
    double before = x.z[k];
    double now = x.v[k];
    double next = alpha[k] - damping * now - kappa * before;
    magnitude += std::abs(p * before) + std::abs(r * now);
    for (std::size_t j = 0; j <= degree; ++j) {
      d[j] += p * before + r * now;
      before = now;
      now = next;
      next = -damping * now - kappa * before;
    }
    // before, now, next are the derivatives p+1, p+2, p+3; the energy of derivative p+1 bounds p+1
    // only through p: sqrt(kappa) |z^(p)| = |now + damping before| / sqrt(kappa).
    const double root = oscillators.root_kappa()[k];
    const double previous = root > 0.0 ? std::abs(now + damping * before) / root : 0.0;
    bound += std::abs(p) * (std::abs(before) + previous) +
             std::abs(r) * (std::abs(now) + root * std::abs(before));
  }
  d[0] += constant;
  for (std::size_t j = 0; j <= degree; ++j) e.a[j] = d[j] * inverse_factorials[j];
  e.bound = bound * inverse_factorials[degree + 1];
  e.noise = 4.0 * epsilon * magnitude;
  return e;
}

// Rounding noise of phi^(j) / j!.
double noise_of(int order, const Signal& signal, const Oscillators& oscillators,
                const OscillatorState& x, const Eigen::ArrayXd& alpha, Eigen::Index count) {
  double magnitude = 0.0;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double damping = 2.0 * oscillators.delta()[k];
    const double kappa = oscillators.kappa()[k];
    double before = x.z[k];
    double now = x.v[k];
    double next = std::abs(alpha[k]) + damping * std::abs(now) + kappa * std::abs(before);
    for (int j = 0; j < order; ++j) {
      before = now;
      now = next;
      next = damping * std::abs(now) + kappa * std::abs(before);
    }
    magnitude += std::abs(signal.p[k] * before) + std::abs(signal.r[k] * now);
  }
  return 8.0 * epsilon * magnitude * inverse_factorials[static_cast<std::size_t>(order)];
}

// Polynomial in Bernstein form on a piece [low, low + length] of [0, 1].
struct Piece {
  Coefficients b;
  double low;
  double length;
};

// Splits at s in (0, 1): `piece` keeps the left part, the right part is returned (de Casteljau).
Piece split(Piece& piece, int n, double s) {
  Piece right;
  Coefficients b = piece.b;
  right.b[static_cast<std::size_t>(n)] = b[static_cast<std::size_t>(n)];
  for (int level = 1; level <= n; ++level) {
    for (int i = 0; i <= n - level; ++i) {
      const auto k = static_cast<std::size_t>(i);
      b[k] += s * (b[k + 1] - b[k]);
    }
    piece.b[static_cast<std::size_t>(level)] = b[0];
    right.b[static_cast<std::size_t>(n - level)] = b[static_cast<std::size_t>(n - level)];
  }
  right.low = piece.low + s * piece.length;
  right.length = (1.0 - s) * piece.length;
  piece.length *= s;
  return right;
}

// Lower bound, tight to a per mille of b[0], of the first root in (0, 1] of a polynomial of degree
// n with b[0] > 0; infinity where there is none. From the convex hull of the Bernstein
// coefficients.
double first_root(const Coefficients& b, int n) {
  constexpr int max_depth = 40;
  std::array<Piece, max_depth> later;
  int depth = 0;
  const double tolerance = 1e-3 * b[0];
  Piece piece{b, 0.0, 1.0};
  for (int iteration = 0; iteration < 400; ++iteration) {
    double s = infinity;
    for (int i = 1; i <= n; ++i) {
      const double bi = piece.b[static_cast<std::size_t>(i)];
      if (bi < 0.0) s = std::min(s, i * piece.b[0] / (n * (piece.b[0] - bi)));
    }
    if (s > 1.0) {  // no root in this piece
      if (depth == 0) return infinity;
      piece = later[static_cast<std::size_t>(--depth)];
      if (piece.b[0] <= tolerance) return piece.low;
      continue;
    }
    if (s > 0.25 || depth == max_depth) {
      if (s >= 1.0) return piece.low + piece.length;
      piece = split(piece, n, s);
      if (piece.b[0] <= tolerance || piece.length < 1e-15) return piece.low;
    } else {
      later[static_cast<std::size_t>(depth++)] = split(piece, n, std::min(4.0 * s, 0.5));
      if (piece.length < 1e-15) return piece.low;
    }
  }
  return piece.low;
}

// Root of a power-form polynomial by Newton's method from s, from where it falls; NaN if it does
// not settle within [s, limit].
double polish(const Coefficients& c, int n, double s, double limit, double resolution,
              double& slope) {
  const double start = s;
  for (int iteration = 0; iteration < 30; ++iteration) {
    double value = c[static_cast<std::size_t>(n)];
    slope = 0.0;
    for (int j = n - 1; j >= 0; --j) {
      slope = slope * s + value;
      value = value * s + c[static_cast<std::size_t>(j)];
    }
    if (slope >= 0.0) return std::nan("");
    const double step = value / slope;
    s -= step;
    if (s < start * (1.0 - 1e-9) || s > limit) return std::nan("");
    if (std::abs(step) <= resolution) return s;
  }
  return std::nan("");
}

struct Verdict {
  double certified = 0.0;  // positive before this
  double root = infinity;  // accepted root
  double next = 0.0;       // phi at `certified`, roughly
};

// `omitted` bounds what expand_signal was not given.
Verdict judge(const Expansion& e, int order, double omitted, double resolution) {
  const auto a = [&](int j) { return e.a[static_cast<std::size_t>(j)]; };
  const int n = degree - order;
  const double lead = a(order) - omitted;
  double H = infinity;
  if (e.bound > 0.0) {
    H = std::exp2(std::log2(remainder_share * lead / e.bound) / (n + 1));
  } else {
    // A polynomial (free fall): its first root is no farther than where a negative term wins.
    double reach = 0.0;
    for (int j = 1; j <= n; ++j) {
      if (a(order + j) < 0.0) {
        reach = std::max(reach, 2.0 * std::pow(-n * lead / a(order + j), 1.0 / j));
      }
    }
    if (reach == 0.0) return {infinity, infinity, lead};
    for (int j = 1; j <= n; ++j) {
      if (a(order + j) < 0.0) continue;
      for (int i = 1; i <= n; ++i) {
        if (a(order + i) < 0.0 && i > j) {
          reach = std::max(reach, std::pow(-n * a(order + j) / a(order + i), 1.0 / (i - j)));
        }
      }
    }
    H = 2.0 * reach;
  }

  Coefficients c{};
  double power = 1.0;
  for (int j = 0; j <= n; ++j) {
    c[static_cast<std::size_t>(j)] = a(order + j) * power;
    power *= H;
  }
  const double remainder = e.bound * power + omitted;  // power = H^(n+1)
  Coefficients b{};
  const auto& convert = bernstein[static_cast<std::size_t>(n)];
  for (std::size_t i = 0; i <= static_cast<std::size_t>(n); ++i) {
    for (std::size_t j = 0; j <= i; ++j) b[i] += convert[i][j] * c[j];
    b[i] -= remainder;
  }
  const double low = first_root(b, n);
  const auto evaluate = [&](double s) {
    double value = c[static_cast<std::size_t>(n)];
    for (int j = n - 1; j >= 0; --j) value = value * s + c[static_cast<std::size_t>(j)];
    return value * std::pow(s * H, order);
  };
  if (low == infinity) return {H, infinity, evaluate(1.0)};

  Verdict verdict{low * H, infinity, evaluate(low)};
  const double local = e.bound * std::pow(low * H, n + 1) + omitted;
  if (local * H > remainder_share * resolution * std::abs(c[0] / low)) return verdict;
  for (std::size_t i = 0; i <= static_cast<std::size_t>(n); ++i) b[i] += remainder;
  const double near = first_root(b, n);
  if (near == infinity) return verdict;
  double slope = 0.0;
  const double s = polish(c, n, near, 1.0, 0.125 * resolution / H, slope);
  if (std::isnan(s)) return verdict;
  const double error = (e.bound * std::pow(s * H, n + 1) + omitted) * H / std::abs(slope);
  if (error <= 0.25 * resolution) verdict.root = s * H;
  return verdict;
}

double signal_constant(const Watch& watch, const Motion& motion) {
  return watch.sign * (watch.signal->constant + watch.signal->held.dot(motion.held));
}

}  // namespace

void EventSearch::reserve(std::size_t watches, Eigen::Index oscillators) {
  states_.reserve(watches);
  tail_.reserve(watches * static_cast<std::size_t>(oscillators + 1));
  x_.z.setZero(oscillators);
  x_.v.setZero(oscillators);
}

void EventSearch::begin(const Motion& start, std::span<const Watch> watches) {
  start_ = &start;
  certified_ = 0.0;
  found_ = false;
  need_all_ = true;
  x_ = start.x;
  states_.resize(watches.size());
  const Oscillators& oscillators = start.flow->oscillators();
  const Eigen::Index n = oscillators.size();
  tail_.resize(watches.size() * static_cast<std::size_t>(n + 1));
  for (std::size_t i = 0; i < watches.size(); ++i) {
    const Watch& watch = watches[i];
    states_[i] = {watch, signal_constant(watch, start), 0.0, infinity, false};
    double* tail = tail_.data() + i * static_cast<std::size_t>(n + 1);
    tail[n] = 0.0;
    for (Eigen::Index k = n - 1; k >= 0; --k) {
      const double root = oscillators.root_kappa()[k];
      const double z = std::abs(start.x.z[k]);
      const double v = std::abs(start.x.v[k]);
      // Without stiffness z has no bound: such a mode is always evaluated.
      const double z_bound = root > 0.0 ? z + v / root : infinity;
      const double p = std::abs(watch.signal->p[k]);
      tail[k] = tail[k + 1] + (p > 0.0 ? p * z_bound : 0.0) +
                std::abs(watch.signal->r[k]) * (v + root * z + std::abs(start.alpha[k]));
    }
  }
}

Eigen::Index EventSearch::oscillators_needed() const {
  const Eigen::Index n = start_->flow->size();
  if (need_all_) return n;
  Eigen::Index needed = start_->flow->frequencies();
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const double* tail = tail_.data() + i * static_cast<std::size_t>(n + 1);
    while (needed < n && !(tail[needed] <= 0.125 * states_[i].predicted)) ++needed;
  }
  return needed;
}

void EventSearch::expand() {
  ++expansions_;
  const Flow& flow = *start_->flow;
  const Eigen::Index n = flow.size();
  const Eigen::Index count = oscillators_needed();
  const Instant now = start_->t + certified_;
  if (certified_ > 0.0) {
    flow.set_phases(now, x_);
    flow.oscillators().propagate(start_->x, start_->alpha, certified_, flow.frequencies(),
                                 count - flow.frequencies(), x_);
  }
  const double t = std::abs(start_->t.hi) + certified_;
  const double resolution = epsilon * std::max(t, 1e-3);

  double certified = infinity;
  double root = infinity;
  need_all_ = false;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    WatchState& state = states_[i];
    state.root = infinity;
    const Signal& signal = *state.watch.signal;
    const double omitted =
        tail_[i * static_cast<std::size_t>(n + 1) + static_cast<std::size_t>(count)];
    const Expansion e = expand_signal(signal, state.watch.sign, state.constant, flow.oscillators(),
                                      x_, start_->alpha, count);
    int order = certified_ > 0.0 ? 0 : state.watch.order;
    if (omitted > 0.0 && omitted > 0.5 * e.a[0]) {
      need_all_ = true;
      certified = 0.0;
      continue;
    }
    bool falls_now = false;
    double noise = order == 0 ? e.noise : 0.0;
    while (order <= degree && e.a[static_cast<std::size_t>(order)] <= noise) {
      if (order > 0) {
        noise = noise_of(order, signal, flow.oscillators(), x_, start_->alpha, count);
      }
      if (e.a[static_cast<std::size_t>(order)] < -noise) {
        falls_now = true;
        break;
      }
      if (e.a[static_cast<std::size_t>(order)] > noise) break;
      ++order;
      noise = 0.0;
    }
    Verdict verdict;
    if (falls_now) {
      verdict = {0.0, 0.0, 0.0};
    } else if (order > degree) {
      verdict = {infinity, infinity, 0.0};
    } else {
      verdict = judge(e, order, omitted, resolution);
    }
    state.predicted = verdict.next;
    certified = std::min(certified, verdict.root < infinity ? verdict.root : verdict.certified);
    root = std::min(root, verdict.root);
    state.root = verdict.root;
  }
  const double together = simultaneous * (1.0 + t);
  if (root < infinity && root <= certified + together) {
    for (WatchState& state : states_) state.fires = state.root <= root + together;
    found_ = true;
    tau_ = certified_ + root;
    return;
  }
  certified_ += certified;
}

void EventSearch::advance(double tau) {
  while (!found_ && certified_ <= tau) expand();
}

}  // namespace sprag
