#include "sprag/mechanics/event_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "sprag/mechanics/bernstein.h"
#include "sprag/mechanics/interrupt.h"

namespace sprag {
namespace {

constexpr std::size_t index(Eigen::Index i) { return static_cast<std::size_t>(i); }

// Lower bounds have one term more, the remainder.
constexpr int degree = bernstein::degree - 1;
constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr double infinity = std::numeric_limits<double>::infinity();
// Below this a motion has died out; its roundings are no longer relative.
constexpr double nothing = 1e-290;

// Two events closer than this share of their time are one.
constexpr double simultaneous = 1e-13;

using bernstein::Coefficients;

constexpr std::array<double, degree + 2> inverse_factorials = [] {
  std::array<double, degree + 2> values{};
  double factorial = 1.0;
  for (int j = 0; j < degree + 2; ++j) {
    values[index(j)] = 1.0 / factorial;
    factorial *= j + 1;
  }
  return values;
}();

struct Expansion {
  Coefficients a{};    // phi^(j) / j!, j = 0..degree
  double bound = 0.0;  // of |phi^(p+1)| / (p+1)! from now on
  double noise = 0.0;  // rounding of a[0]
};

// What a drive adds to the derivatives of phi, as if its oscillator were at rest: theirs add up.
// Returns its share in the bound of the one after the last, which holds up to reach().
double expand_drive(const Drive& drive, double p, double r, const Oscillators& oscillators,
                    const OscillatorState& x, double reach, Coefficients& d) {
  const double damping = 2.0 * oscillators.delta()[drive.mode];
  const double kappa = oscillators.kappa()[drive.mode];
  const double kappa_source = oscillators.kappa()[drive.source];
  const double root_source = oscillators.root_kappa()[drive.source];
  double force = drive.force(x);
  double next_force = drive.force_rate(oscillators, x);
  const double amplitude = std::hypot(force, next_force / root_source);
  double last = 0.0;
  double before = 0.0;
  double now = 0.0;
  double next = force;
  double fastest = amplitude;  // |F^(j)| at most
  for (std::size_t j = 0; j <= degree; ++j) {
    d[j] += p * before + r * now;
    last = before;
    before = now;
    now = next;
    next = next_force - damping * now - kappa * before;
    force = std::exchange(next_force, -kappa_source * force);
    if (j < degree) fastest *= root_source;
  }
  // Energy of derivative p, which F^(p) feeds: sqrt(z^(p+1)^2 + kappa z^(p)^2) grows by |F^(p)| a
  // unit of time at most.
  const double root = oscillators.root_kappa()[drive.mode];
  return std::abs(p) * (std::abs(before) + root * std::abs(last) + reach * fastest) +
         std::abs(r) * (std::abs(now) + root * std::abs(before) + reach * root_source * fastest);
}

// First `count` oscillators only.
Expansion expand_signal(const Signal& signal, double sign, double constant,
                        const Oscillators& oscillators, const Drives& drives,
                        const OscillatorState& x, const Eigen::ArrayXd& alpha, Eigen::Index count) {
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
  for (const Drive& drive : drives.all()) {
    if (drive.mode >= count) break;
    bound += expand_drive(drive, sign * signal.p[drive.mode], sign * signal.r[drive.mode],
                          oscillators, x, drives.reach(), d);
  }
  d[0] += constant;
  for (std::size_t j = 0; j <= degree; ++j) e.a[j] = d[j] * inverse_factorials[j];
  e.bound = bound * inverse_factorials[degree + 1];
  e.noise = 4.0 * epsilon * magnitude + nothing;
  return e;
}

// Rounding noise of phi^(j) / j!.
double noise_of(int order, const Signal& signal, const Oscillators& oscillators,
                const Drives& drives, const OscillatorState& x, const Eigen::ArrayXd& alpha,
                Eigen::Index count) {
  double magnitude = 0.0;
  for (const Drive& drive : drives.all()) {
    if (drive.mode >= count) break;
    const double damping = 2.0 * oscillators.delta()[drive.mode];
    const double kappa = oscillators.kappa()[drive.mode];
    double force = std::abs(drive.force(x));
    double next_force = std::abs(drive.force_rate(oscillators, x));
    double before = 0.0;
    double now = 0.0;
    double next = force;
    for (int j = 0; j < order; ++j) {
      before = now;
      now = next;
      next = next_force + damping * now + kappa * before;
      force = std::exchange(next_force, oscillators.kappa()[drive.source] * force);
    }
    magnitude += std::abs(signal.p[drive.mode]) * before + std::abs(signal.r[drive.mode]) * now;
  }
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
  return 8.0 * epsilon * magnitude * inverse_factorials[index(order)] + nothing;
}

struct Verdict {
  double certified = 0.0;  // positive before this
  double root = infinity;  // accepted root
  double next = 0.0;       // phi at `certified`, roughly
};

// n-th root of x >= 0 within a tenth: a double's bits are nearly a logarithm of it. Powers 2^(n k)
// in x are powers 2^k in the root, exactly.
double rough_root(double x, int n) {
  constexpr auto one = std::bit_cast<std::int64_t>(1.0);
  const double normal =
      std::clamp(x, std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
  const std::int64_t logarithm = std::bit_cast<std::int64_t>(normal) - one;
  const std::int64_t share = logarithm / n - (logarithm % n < 0 ? 1 : 0);  // rounded down
  return std::bit_cast<double>(one + share);
}

// How far a polynomial without remainder (free fall) can matter: beyond, its highest falling term
// outweighs all others.
double reach_of(const Expansion& e, int order) {
  double reach = 0.0;
  for (int i = order + 1; i <= degree; ++i) {
    const double falling = e.a[index(i)];
    if (falling >= 0.0) continue;
    for (int j = order; j < i; ++j) {
      const double rising = e.a[index(j)];
      if (rising > 0.0) {
        reach = std::max(reach, 2.25 * rough_root(-degree * rising / falling, i - j));
      }
    }
  }
  return reach;
}

// First positive root of c0 + c1 x + c2 x^2, c0 > 0; infinity if there is none.
double quadratic_root(double c0, double c1, double c2) {
  const double discriminant = c1 * c1 - 4.0 * c0 * c2;
  if (discriminant < 0.0) return infinity;
  const double denominator = -c1 + std::sqrt(discriminant);
  return denominator > 0.0 ? 2.0 * c0 / denominator : infinity;
}

// A root in (0, H) of sum a_j x^j that the first terms show, from a little below; infinity if none
// is found. Not surely the first one.
double visible_root(const double* a, int n, double H) {
  constexpr double a_little = 0x1p-9;
  if (n < 2) return infinity;
  double x = quadratic_root(a[0], a[1], a[2]);
  for (int iteration = 0; iteration < 6; ++iteration) {
    if (!(x > 0.0 && x < H)) return infinity;
    double value = a[n];
    double slope = 0.0;
    for (int j = n - 1; j >= 0; --j) {
      slope = slope * x + value;
      value = value * x + a[j];
    }
    if (!(slope < 0.0)) return infinity;
    const double step = value / slope;
    x -= step;
    if (std::abs(step) <= 0.25 * a_little * x) return (1.0 - a_little) * x;
  }
  return infinity;
}

// `omitted` bounds what expand_signal was not given; phi has a zero of the given order at 0, which
// is divided out. Time is resolved to a rounding of `now` and what is to come.
Verdict judge(const Expansion& e, int order, double omitted, double now) {
  const int n = degree - order;
  const double lead = e.a[index(order)] - omitted;
  double H = 0.0;
  if (e.bound > 0.0) {
    // Somewhat less than where the remainder alone outweighs the start: most such intervals show
    // no root at once.
    H = 0.8 * rough_root(lead / e.bound, n + 1);
  } else {
    H = reach_of(e, order);
    if (H == 0.0) return {infinity, infinity, lead};
  }

  Coefficients lower{};
  for (int j = 0; j <= n; ++j) {
    lower[index(j)] = e.a[index(j) + index(order)];
  }
  lower[0] -= omitted;
  lower[index(n) + 1] = -e.bound;
  // A root in sight ends the interval: it is the first if nothing before it is.
  const double in_sight = visible_root(lower.data(), n + 1, H);
  if (in_sight < infinity) H = in_sight;

  // On s = x / H in [0, 1].
  Coefficients c{};
  double power = 1.0;
  for (int j = 0; j <= n; ++j) {
    c[index(j)] = e.a[index(j) + index(order)] * power;
    lower[index(j)] *= power;
    power *= H;
  }
  const double remainder = e.bound * power;  // power = H^(n+1)
  lower[index(n) + 1] = -remainder;
  const Coefficients b = bernstein::from_power(lower);
  const bool positive = *std::min_element(b.begin(), b.end()) > 0.0;
  double low = positive ? infinity : bernstein::first_root(b);
  if (low == infinity && in_sight < infinity) low = 1.0;
  const double end = std::min(low, 1.0);

  double value = 0.0;
  double slope = 0.0;
  const auto evaluate = [&](double s) {
    value = c[index(n)];
    slope = 0.0;
    for (int j = n - 1; j >= 0; --j) {
      slope = slope * s + value;
      value = value * s + c[index(j)];
    }
  };
  evaluate(end);
  double scale = 1.0;
  for (int j = 0; j < order; ++j) scale *= end * H;
  Verdict verdict{end * H, infinity, value * scale};
  if (low == infinity || omitted > 0.0) return verdict;

  // Close to a root of the polynomial itself the remainder hardly counts: is it this one?
  const double resolution = epsilon * (now + end * H);
  const auto error = [&](double s) {
    double size = remainder * H;
    for (int j = 0; j <= n; ++j) size *= s;
    return size / std::abs(slope);
  };
  if (slope >= 0.0 || error(low) > resolution) return verdict;
  double s = low;
  const double limit = low + 4.0 * std::abs(value / slope);
  for (int iteration = 0; iteration < 30; ++iteration) {
    const double step = value / slope;
    s -= step;
    if (std::abs(step) * H <= 0.125 * resolution) break;
    if (s > limit || s < low * (1.0 - 1e-9)) return verdict;
    evaluate(s);
    if (slope >= 0.0) return verdict;
  }
  if (error(s) <= 0.25 * resolution) verdict.root = s * H;
  return verdict;
}

double signal_constant(const Watch& watch, const Motion& motion) {
  return watch.sign * (watch.signal->constant + watch.signal->held.dot(motion.held));
}

}  // namespace

void EventSearch::reserve(std::size_t watches, Eigen::Index oscillators) {
  states_.reserve(watches);
  tail_.reserve(watches * (index(oscillators) + 1));
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
  tail_.resize(watches.size() * (index(n) + 1));
  for (std::size_t i = 0; i < watches.size(); ++i) {
    const Watch& watch = watches[i];
    states_[i] = {watch, signal_constant(watch, start), 0.0, infinity, infinity, false};
    double* tail = tail_.data() + i * (index(n) + 1);
    tail[n] = 0.0;
    for (Eigen::Index k = n - 1; k >= 0; --k) {
      const double root = oscillators.root_kappa()[k];
      const double z = std::abs(start.x.z[k]);
      const double v = std::abs(start.x.v[k]);
      const double push = std::abs(start.alpha[k]);
      const double p = std::abs(watch.signal->p[k]);
      const double r = std::abs(watch.signal->r[k]);
      // The energy about the rest alpha / kappa only falls. Without stiffness z has no bound, and
      // z' none where it is pushed: such a mode is always evaluated.
      const double v_bound = v + root * z + (push > 0.0 ? push / root : 0.0);
      const double z_bound = root > 0.0 ? (v_bound + push / root) / root : infinity;
      tail[k] = tail[k + 1] + (p > 0.0 ? p * z_bound : 0.0) + (r > 0.0 ? r * v_bound : 0.0);
    }
    for (const Drive& drive : start.flow->drives().all()) {
      if (watch.signal->p[drive.mode] == 0.0 && watch.signal->r[drive.mode] == 0.0) continue;
      std::fill(tail, tail + drive.mode + 1, infinity);
    }
  }
}

Eigen::Index EventSearch::oscillators_needed() const {
  const Eigen::Index n = start_->flow->size();
  if (need_all_) return n;
  Eigen::Index needed = start_->flow->frequencies();
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const double* tail = tail_.data() + i * (index(n) + 1);
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
    flow.move_modes(*start_, certified_, count - flow.frequencies(), x_);
  }
  const double t = std::abs(start_->t.hi) + certified_;
  const double resolution = epsilon * t;

  double certified = infinity;
  double root = infinity;
  need_all_ = false;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    WatchState& state = states_[i];
    state.root = state.certified = infinity;
    const Signal& signal = *state.watch.signal;
    const double omitted = tail_[i * (index(n) + 1) + index(count)];
    const Expansion e = expand_signal(signal, state.watch.sign, state.constant, flow.oscillators(),
                                      flow.drives(), x_, start_->alpha, count);
    int order = certified_ > 0.0 ? 0 : state.watch.order;
    if (omitted > 0.0 && omitted > 0.5 * e.a[0]) {
      need_all_ = true;
      certified = 0.0;
      continue;
    }
    bool falls_now = false;
    // A derivative that does not vanish by construction counts if it stands out of its rounding.
    double noise = order == 0 ? e.noise : 0.0;
    while (order <= degree && e.a[index(order)] <= noise) {
      if (noise == 0.0)
        noise =
            noise_of(order, signal, flow.oscillators(), flow.drives(), x_, start_->alpha, count);
      falls_now = e.a[index(order)] < -noise;
      if (falls_now || ++order > degree) break;
      noise = noise_of(order, signal, flow.oscillators(), flow.drives(), x_, start_->alpha, count);
    }
    Verdict verdict;
    if (falls_now) {
      // The last step may have gone past the root by what its coefficients were rounded.
      const double past = certified_ > 0.0 && e.a[1] < 0.0 ? std::max(e.a[0] / e.a[1], 0.0) : 0.0;
      verdict = {0.0, -std::min(past, 1e-8 * t), 0.0};
    } else if (order > degree) {
      verdict = {infinity, infinity, 0.0};
    } else {
      verdict = judge(e, order, omitted, t);
    }
    if (verdict.root > flow.drives().reach()) verdict.root = infinity;
    verdict.certified = std::min(verdict.certified, flow.drives().reach());
    state.predicted = verdict.next;
    certified = std::min(certified, verdict.root < infinity ? verdict.root : verdict.certified);
    root = std::min(root, verdict.root);
    state.root = verdict.root;
    state.certified = verdict.certified;
  }
  const double together = simultaneous * (t + root);
  if (root < infinity && root <= certified + together) {
    for (WatchState& state : states_) state.fires = state.root <= root + together;
    found_ = true;
    tau_ = certified_ + root;
    return;
  }
  if (!need_all_ && certified <= 0.25 * resolution) {
    // Time cannot tell this from the zero that lies ahead.
    for (WatchState& state : states_) state.fires = state.certified <= resolution;
    found_ = true;
    tau_ = certified_;
    return;
  }
  certified_ += certified;
}

void EventSearch::advance(double tau) {
  constexpr int expansions_between_looks = 64;  // a few microseconds each
  for (int i = 1; !found_ && certified_ <= tau; ++i) {
    expand();
    if (i % expansions_between_looks == 0) check_interrupt();
  }
}

}  // namespace sprag
