#include "sprag/detail/mechanics/event_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "sprag/detail/mechanics/bernstein.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr std::size_t index(Eigen::Index i) { return static_cast<std::size_t>(i); }

// Degree p of the Taylor polynomial. Lower bounds have one more term, the remainder.
constexpr int degree = bernstein::degree - 1;
// Below this magnitude rounding errors are no longer relative; the motion counts as zero.
constexpr double nothing = 1e-290;

// Two events whose times differ by less than this fraction are simultaneous.
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

// State of a motion, restricted to its first `count` oscillators.
struct Point {
  const Oscillators& oscillators;
  const Drives& drives;
  const OscillatorState& x;
  const Eigen::ArrayXd& alpha;
  Eigen::Index count;
  const Flow* sampled_flow = nullptr;       // set if the flow has sampled inputs
  const PolynomialForce* forces = nullptr;  // of these inputs, per mode
};

struct Expansion {
  Coefficients a{};    // phi^(j) / j!, j = 0..degree
  double bound = 0.0;  // of |phi^(p+1)| / (p+1)! at all later times
  double noise = 0.0;  // rounding of a[0]
};

// Adds a drive's contribution to the derivatives of phi in d. The oscillator counts as at rest,
// since responses superpose. Returns the contribution to the bound of derivative p+1, which holds
// up to reach().
double expand_drive(const Drive& drive, double p, double r, const Point& at, Coefficients& d) {
  const Oscillators& oscillators = at.oscillators;
  const double damping = 2.0 * oscillators.delta()[drive.mode];
  const double kappa = oscillators.kappa()[drive.mode];
  const double kappa_source = oscillators.kappa()[drive.source];
  const double root_source = oscillators.root_kappa()[drive.source];
  double force = drive.force(at.x);
  double next_force = drive.force_rate(oscillators, at.x);
  const double amplitude = std::hypot(force, next_force / root_source);
  double last = 0.0;
  double before = 0.0;
  double now = 0.0;
  double next = force;
  double fastest = amplitude;  // upper bound of |F^(j)|
  const double reach = at.drives.reach();
  for (std::size_t j = 0; j <= degree; ++j) {
    d[j] += p * before + r * now;
    last = before;
    before = now;
    now = next;
    next = next_force - damping * now - kappa * before;
    force = std::exchange(next_force, -kappa_source * force);
    if (j < degree) fastest *= root_source;
  }
  // Derivative p of z is an oscillator under the force F^(p). Its energy norm
  // sqrt(z^(p+1)^2 + kappa z^(p)^2) grows at most at the rate |F^(p)|.
  const double root = oscillators.root_kappa()[drive.mode];
  return std::abs(p) * (std::abs(before) + root * std::abs(last) + reach * fastest) +
         std::abs(r) * (std::abs(now) + root * std::abs(before) + reach * root_source * fastest);
}

// Sums over the oscillators of a signal.
struct Sums {
  Coefficients d{};        // phi^(j)
  double bound = 0.0;      // of |phi^(p+1)| at all later times
  double magnitude = 0.0;  // of the terms of phi
};

// Adds oscillators `first` to `end` - 1 without drives and sampled inputs.
void add_oscillators(const Signal& signal, double sign, const Point& at, Eigen::Index first,
                     Eigen::Index end, Sums& sums) {
  const Oscillators& oscillators = at.oscillators;
  auto& [d, bound, magnitude] = sums;
  for (Eigen::Index k = first; k < end; ++k) {
    const double p = sign * signal.p[k];
    const double r = sign * signal.r[k];
    const double damping = 2.0 * oscillators.delta()[k];
    const double kappa = oscillators.kappa()[k];
    double before = at.x.z[k];
    double now = at.x.v[k];
    double next = at.alpha[k] - damping * now - kappa * before;
    magnitude += std::abs(p * before) + std::abs(r * now);
    for (std::size_t j = 0; j <= degree; ++j) {
      d[j] += p * before + r * now;
      before = now;
      now = next;
      next = -damping * now - kappa * before;
    }
    // before, now, next are the derivatives p+1, p+2, p+3. The energy norm that bounds z^(p+1)
    // needs sqrt(kappa) |z^(p)|, which follows from the oscillator's equation:
    // |now + damping before| / sqrt(kappa).
    const double root = oscillators.root_kappa()[k];
    const double previous = root > 0.0 ? std::abs(now + damping * before) / root : 0.0;
    bound += std::abs(p) * (std::abs(before) + previous) +
             std::abs(r) * (std::abs(now) + root * std::abs(before));
  }
}

Expansion finished(const Signal& signal, double sign, double constant, const Point& at,
                   Sums& sums) {
  auto& [d, bound, magnitude] = sums;
  for (const Drive& drive : at.drives.all()) {
    if (drive.mode >= at.count) break;
    bound += expand_drive(drive, sign * signal.p[drive.mode], sign * signal.r[drive.mode], at, d);
  }
  Expansion e;
  d[0] += constant;
  for (std::size_t j = 0; j <= degree; ++j) e.a[j] = d[j] * inverse_factorials[j];
  e.bound = bound * inverse_factorials[degree + 1];
  e.noise = 4.0 * machine_epsilon * magnitude + nothing;
  return e;
}

// Derivative n of the inputs' chain e, e', a, a', ... that starts at bank entry `first`.
double chain_derivative(const OscillatorState& x, Eigen::Index first, Eigen::Index n) {
  if (n >= chain_terms) return 0.0;
  return n % 2 == 0 ? x.z[first + n / 2] : x.v[first + n / 2];
}

// Adds the inputs themselves. Their derivative p+1 is zero.
void add_inputs(const Signal& signal, double sign, const Point& at, Sums& sums) {
  const SampledResponse& sampled = *at.sampled_flow->sampled();
  for (Eigen::Index c = 0; c < sampled.inputs().channels(); ++c) {
    const Eigen::Index first = sampled.first() + chain_entries * c;
    for (Eigen::Index j = 0; j < chain_entries; ++j) {
      const double p = sign * signal.p[first + j];
      const double r = sign * signal.r[first + j];
      if (p == 0.0 && r == 0.0) continue;
      sums.magnitude += std::abs(p * at.x.z[first + j]) + std::abs(r * at.x.v[first + j]);
      for (Eigen::Index n = 0; n <= degree; ++n) {
        sums.d[index(n)] += p * chain_derivative(at.x, first, 2 * j + n) +
                            r * chain_derivative(at.x, first, 2 * j + n + 1);
      }
    }
  }
}

// Adds the modes, each as the sum of its own motion and its response to the inputs, under the
// force of the inputs. That force is a polynomial of degree < p, so that derivative p obeys the
// undriven equation up to the next knot. Own motions from at.count on are left out.
void add_driven_modes(const Signal& signal, double sign, const Point& at, Sums& sums) {
  const Flow& flow = *at.sampled_flow;
  const SampledResponse& sampled = *flow.sampled();
  const Oscillators& oscillators = at.oscillators;
  for (Eigen::Index i = 0; i < sampled.modes(); ++i) {
    const Eigen::Index k = flow.frequencies() + i;
    const Eigen::Index y = sampled.first_mode() + i;
    const double p = sign * signal.p[y];
    const double r = sign * signal.r[y];
    if (p == 0.0 && r == 0.0) continue;
    const double damping = 2.0 * oscillators.delta()[k];
    const double kappa = oscillators.kappa()[k];
    const PolynomialForce& F = at.forces[i];
    double before = at.x.z[y];
    double now = at.x.v[y];
    double push = F[0];
    sums.magnitude += std::abs(p * before) + std::abs(r * now);
    if (k < at.count) {
      sums.magnitude += std::abs(p * at.x.z[k]) + std::abs(r * at.x.v[k]);
      before += at.x.z[k];
      now += at.x.v[k];
      push += at.alpha[k];
    }
    double next = push - damping * now - kappa * before;
    for (std::size_t j = 0; j <= degree; ++j) {
      sums.d[j] += p * before + r * now;
      before = now;
      now = next;
      next = (j + 1 < polynomial_terms ? F[j + 1] : 0.0) - damping * now - kappa * before;
    }
    const double root = oscillators.root_kappa()[k];
    const double previous = root > 0.0 ? std::abs(now + damping * before) / root : 0.0;
    sums.bound += std::abs(p) * (std::abs(before) + previous) +
                  std::abs(r) * (std::abs(now) + root * std::abs(before));
  }
}

Expansion expand_signal(const Signal& signal, double sign, double constant, const Point& at) {
  Sums sums;
  sums.magnitude = std::abs(constant);
  if (at.sampled_flow == nullptr) {
    add_oscillators(signal, sign, at, 0, at.count, sums);
  } else {
    add_oscillators(signal, sign, at, 0, at.sampled_flow->harmonics(), sums);
    add_inputs(signal, sign, at, sums);
    add_driven_modes(signal, sign, at, sums);
  }
  return finished(signal, sign, constant, at, sums);
}

// The same without the sampled inputs and the response to them.
Expansion expand_free_part(const Signal& signal, double sign, double constant, const Point& at) {
  Sums sums;
  sums.magnitude = std::abs(constant);
  const Flow& flow = *at.sampled_flow;
  add_oscillators(signal, sign, at, 0, flow.harmonics(), sums);
  add_oscillators(signal, sign, at, flow.frequencies(),
                  std::min(at.count, flow.frequencies() + flow.modes()), sums);
  return finished(signal, sign, constant, at, sums);
}

// Magnitude of the terms of phi^(order) by sampled inputs and modes.
double driven_magnitude(int order, const Signal& signal, const Point& at) {
  const Flow& flow = *at.sampled_flow;
  const SampledResponse& sampled = *flow.sampled();
  double magnitude = 0.0;
  for (Eigen::Index c = 0; c < sampled.inputs().channels(); ++c) {
    const Eigen::Index first = sampled.first() + chain_entries * c;
    for (Eigen::Index j = 0; j < chain_entries; ++j) {
      magnitude += std::abs(signal.p[first + j] * chain_derivative(at.x, first, 2 * j + order)) +
                   std::abs(signal.r[first + j] * chain_derivative(at.x, first, 2 * j + order + 1));
    }
  }
  for (Eigen::Index i = 0; i < sampled.modes(); ++i) {
    const Eigen::Index k = flow.frequencies() + i;
    const Eigen::Index y = sampled.first_mode() + i;
    const double damping = 2.0 * at.oscillators.delta()[k];
    const double kappa = at.oscillators.kappa()[k];
    const PolynomialForce& F = at.forces[i];
    double before = std::abs(at.x.z[y]);
    double now = std::abs(at.x.v[y]);
    double push = std::abs(F[0]);
    if (k < at.count) {
      before += std::abs(at.x.z[k]);
      now += std::abs(at.x.v[k]);
      push += std::abs(at.alpha[k]);
    }
    double next = push + damping * now + kappa * before;
    for (int j = 0; j < order; ++j) {
      before = now;
      now = next;
      const double force = index(j + 1) < polynomial_terms ? std::abs(F[index(j + 1)]) : 0.0;
      next = force + damping * now + kappa * before;
    }
    magnitude += std::abs(signal.p[y]) * before + std::abs(signal.r[y]) * now;
  }
  return magnitude;
}

// Rounding error of phi^(j) / j!.
double noise_of(int order, const Signal& signal, const Point& at) {
  const Oscillators& oscillators = at.oscillators;
  double magnitude = 0.0;
  for (const Drive& drive : at.drives.all()) {
    if (drive.mode >= at.count) break;
    const double damping = 2.0 * oscillators.delta()[drive.mode];
    const double kappa = oscillators.kappa()[drive.mode];
    double force = std::abs(drive.force(at.x));
    double next_force = std::abs(drive.force_rate(oscillators, at.x));
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
  Eigen::Index count = at.count;
  if (at.sampled_flow != nullptr) {
    magnitude += driven_magnitude(order, signal, at);
    count = at.sampled_flow->harmonics();
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    const double damping = 2.0 * oscillators.delta()[k];
    const double kappa = oscillators.kappa()[k];
    double before = at.x.z[k];
    double now = at.x.v[k];
    double next = std::abs(at.alpha[k]) + damping * std::abs(now) + kappa * std::abs(before);
    for (int j = 0; j < order; ++j) {
      before = now;
      now = next;
      next = damping * std::abs(now) + kappa * std::abs(before);
    }
    magnitude += std::abs(signal.p[k] * before) + std::abs(signal.r[k] * now);
  }
  return 8.0 * machine_epsilon * magnitude * inverse_factorials[index(order)] + nothing;
}

struct Verdict {
  double certified = 0.0;  // phi is positive before this time
  double root = infinity;  // accepted root
  double next = 0.0;       // phi at `certified`, approximately; 0 at a root in sight
};

// n-th root of x >= 0 within 10 %, from the bits of the double, which approximate its logarithm.
// A factor 2^(n k) of x becomes the exact factor 2^k of the root.
double rough_root(double x, int n) {
  constexpr auto one = std::bit_cast<std::int64_t>(1.0);
  const double normal =
      std::clamp(x, std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
  const std::int64_t logarithm = std::bit_cast<std::int64_t>(normal) - one;
  const std::int64_t share = logarithm / n - (logarithm % n < 0 ? 1 : 0);  // rounded down
  return std::bit_cast<double>(one + share);
}

// Length over which a polynomial without remainder (free fall) can have a root. Beyond it, the
// highest negative term outweighs all others.
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

// Value and slope of a polynomial.
struct Sample {
  double value;
  double slope;
};

// sum a_j x^j. The constant degree lets the compiler keep the coefficients in registers.
Sample evaluate(const Coefficients& a, double x) {
  Sample at{a.back(), 0.0};
  for (std::size_t j = a.size() - 1; j-- > 0;) {
    at.slope = at.slope * x + at.value;
    at.value = at.value * x + a[j];
  }
  return at;
}

// A root in (0, H) of sum a_j x^j, found by Newton's method from the root of the first three terms
// and reduced by a small fraction. Infinity if none is found. It need not be the first root.
double visible_root(const Coefficients& a, double H) {
  constexpr double a_little = 0x1p-9;
  double x = quadratic_root(a[0], a[1], a[2]);
  for (int iteration = 0; iteration < 6; ++iteration) {
    if (!(x > 0.0 && x < H)) return infinity;
    const auto [value, slope] = evaluate(a, x);
    if (!(slope < 0.0)) return infinity;
    const double step = value / slope;
    x -= step;
    if (std::abs(step) <= 0.25 * a_little * x) return (1.0 - a_little) * x;
  }
  return infinity;
}

// Length of the next interval to examine. Zero: unlimited, since no term is negative.
double interval(const Expansion& e, int order, double lead) {
  // Slightly less than where the remainder alone outweighs the leading term: most such intervals
  // are certified at once.
  if (e.bound > 0.0) return 0.8 * rough_root(lead / e.bound, degree - order + 1);
  return reach_of(e, order);
}

// A polynomial of degree p - order + 1 that is a lower bound of phi / x^order.
Coefficients lower_bound(const Expansion& e, int order, double omitted) {
  const int n = degree - order;
  Coefficients lower{};
  for (int j = 0; j <= n; ++j) lower[index(j)] = e.a[index(j) + index(order)];
  lower[0] -= omitted;
  lower[index(n) + 1] = -e.bound;
  return lower;
}

// phi / x^order for x = s H, s in [0, 1]: sum_j c_j s^j, j = 0..n, up to an error of at most
// remainder s^(n+1).
struct Scaled {
  double H;
  int n;
  Coefficients c{};
  double remainder = 0.0;
};

// Rescales `lower` from x to s as well.
Scaled scaled(const Expansion& e, int order, double H, Coefficients& lower) {
  Scaled phi{H, degree - order};
  double power = 1.0;
  for (int j = 0; j <= phi.n; ++j) {
    phi.c[index(j)] = e.a[index(j) + index(order)] * power;
    lower[index(j)] *= power;
    power *= H;
  }
  phi.remainder = e.bound * power;
  lower[index(phi.n) + 1] = -phi.remainder;
  return phi;
}

// Newton's method for a root of the polynomial just after `low`. Near it the remainder has hardly
// any effect. Returns the root if the remainder moves it by less than the resolution of time, else
// infinity.
double accepted_root(const Scaled& phi, double low, Sample at, double resolution) {
  const auto error = [&phi](double s, double slope) {
    double size = phi.remainder * phi.H;
    for (int j = 0; j <= phi.n; ++j) size *= s;
    return size / std::abs(slope);
  };
  if (at.slope >= 0.0 || error(low, at.slope) > resolution) return infinity;
  double s = low;
  const double limit = low + 4.0 * std::abs(at.value / at.slope);
  for (int iteration = 0; iteration < 30; ++iteration) {
    const double step = at.value / at.slope;
    s -= step;
    if (std::abs(step) * phi.H <= 0.125 * resolution) break;
    if (s > limit || s < low * (1.0 - 1e-9)) return infinity;
    at = evaluate(phi.c, s);
    if (at.slope >= 0.0) return infinity;
  }
  return error(s, at.slope) <= 0.25 * resolution ? s * phi.H : infinity;
}

// Examines phi from an expansion point on. phi has a zero of the given order there, which is
// divided out. `omitted` bounds the oscillators that expand_signal left out. Time is resolved to
// the rounding of `now` plus the interval. The expansion holds up to `longest`.
Verdict judge(const Expansion& e, int order, double omitted, double now, double longest) {
  const double lead = e.a[index(order)] - omitted;
  double H = interval(e, order, lead);
  if (H == 0.0) return {infinity, infinity, lead};
  H = std::min(H, longest);

  // A visible root ends the interval. It is the first root if the interval before it has none.
  Coefficients lower = lower_bound(e, order, omitted);
  const double in_sight = visible_root(lower, H);
  if (in_sight < infinity) H = in_sight;

  const Scaled phi = scaled(e, order, H, lower);
  const Coefficients b = bernstein::from_power(lower);
  const bool positive = *std::min_element(b.begin(), b.end()) > 0.0;
  double low = positive ? infinity : bernstein::first_root(b);
  if (low == infinity && in_sight < infinity) low = 1.0;
  const double end = std::min(low, 1.0);

  const Sample at_end = evaluate(phi.c, end);
  // Near a root that is in sight, the next expansion takes all oscillators and accepts it.
  double next = 0.0;
  if (in_sight == infinity) {
    next = at_end.value;
    for (int j = 0; j < order; ++j) next *= end * H;
  }
  Verdict verdict{end * H, infinity, next};
  if (low < infinity && !(omitted > 0.0)) {
    verdict.root = accepted_root(phi, low, at_end, machine_epsilon * (now + end * H));
  }
  return verdict;
}

// The first derivative of phi, from `order` on, that exceeds its rounding error; degree + 1 if
// there is none. `falls` is set if that derivative is negative.
struct Leading {
  int order;
  bool falls = false;
};

Leading leading(const Expansion& e, int order, const Signal& signal, const Point& at) {
  double noise = order == 0 ? e.noise : 0.0;
  while (order <= degree && e.a[index(order)] <= noise) {
    if (noise == 0.0) noise = noise_of(order, signal, at);
    if (e.a[index(order)] < -noise) return {order, true};
    if (++order > degree) break;
    noise = noise_of(order, signal, at);
  }
  return {order};
}

// tail[k], k = 0..N: bound of the contribution of oscillators k..N-1 to the signal at all later
// times.
void bound_tail(const Signal& signal, const Motion& start, double* tail) {
  const Oscillators& oscillators = start.flow->oscillators();
  const Eigen::Index n = oscillators.size();
  tail[n] = 0.0;
  for (Eigen::Index k = n - 1; k >= 0; --k) {
    const double root = oscillators.root_kappa()[k];
    const double z = std::abs(start.x.z[k]);
    const double v = std::abs(start.x.v[k]);
    const double push = std::abs(start.alpha[k]);
    const double p = std::abs(signal.p[k]);
    const double r = std::abs(signal.r[k]);
    // The energy about the rest position alpha / kappa never grows. Without stiffness z has no
    // bound, and with a constant force z' has none either: such a mode is always evaluated.
    const double v_bound = v + root * z + (push > 0.0 ? push / root : 0.0);
    const double z_bound = root > 0.0 ? (v_bound + push / root) / root : infinity;
    tail[k] = tail[k + 1] + (p > 0.0 ? p * z_bound : 0.0) + (r > 0.0 ? r * v_bound : 0.0);
  }
  for (const Drive& drive : start.flow->drives().all()) {
    if (signal.p[drive.mode] == 0.0 && signal.r[drive.mode] == 0.0) continue;
    std::fill(tail, tail + drive.mode + 1, infinity);
  }
}

double signal_constant(const Watch& watch, const Motion& motion) {
  return watch.sign * (watch.signal->constant + watch.signal->held.dot(motion.held));
}

}  // namespace

void EventSearch::reserve(std::size_t watches, Eigen::Index oscillators) {
  states_.reserve(watches);
  tail_.reserve(watches * (index(oscillators) + 1));
  marches_.reserve(watches);
  forces_.reserve(index(oscillators));
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
  const std::size_t row = index(start.flow->size()) + 1;
  tail_.resize(watches.size() * row);
  for (std::size_t i = 0; i < watches.size(); ++i) {
    states_[i] = {watches[i], signal_constant(watches[i], start), 0.0, infinity, infinity, false};
    bound_tail(*watches[i].signal, start, tail_.data() + i * row);
  }
  sampled_ = start.flow->sampled();
  if (sampled_ == nullptr) return;
  const SampledInputs& inputs = sampled_->inputs();
  interval_ = inputs.interval(start.t.hi);
  // A start within rounding of the next knot belongs to the next interval.
  if (to_next_knot() <= 4.0 * machine_epsilon * std::abs(start.t.hi)) ++interval_;
  at_knot_ = false;
  march_end_ = -1.0;
  stride_ = SampledResponse::block;
  marches_.resize(watches.size());
  forces_.resize(index(sampled_->modes()));
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

// Examines watch i from the present point x_ at time |t| with the first `count` oscillators, up to
// `longest` after it. Sets need_all_ if the bound of the omitted ones is too large for a
// conclusion.
void EventSearch::look(std::size_t i, Eigen::Index count, double t, double longest) {
  WatchState& state = states_[i];
  const Flow& flow = *start_->flow;
  const Point here{flow.oscillators(), flow.drives(), x_,
                   start_->alpha,      count,         sampled_ != nullptr ? &flow : nullptr,
                   forces_.data()};
  const double omitted = tail_[i * (index(flow.size()) + 1) + index(count)];
  const Signal& signal = *state.watch.signal;
  const Expansion e = expand_signal(signal, state.watch.sign, state.constant, here);
  if (omitted > 0.0 && omitted > 0.5 * e.a[0]) {
    need_all_ = true;
    state.certified = 0.0;
    state.root = infinity;
    return;
  }
  const Leading lead = leading(e, certified_ > 0.0 ? 0 : state.watch.order, signal, here);
  Verdict verdict;
  if (lead.falls) {
    // The last step may have passed the root by the rounding of its coefficients.
    const double past = certified_ > 0.0 && e.a[1] < 0.0 ? std::max(e.a[0] / e.a[1], 0.0) : 0.0;
    verdict = {0.0, -std::min(past, 1e-8 * t), 0.0};
  } else if (lead.order > degree) {
    verdict = {infinity, infinity, 0.0};
  } else {
    verdict = judge(e, lead.order, omitted, t, longest);
  }
  const double reach = std::min(flow.drives().reach(), longest);
  state.certified = std::min(verdict.certified, reach);
  state.root = verdict.root > reach ? infinity : verdict.root;
  state.predicted = verdict.next;
}

// Time of a knot after the start.
double EventSearch::time_of_knot(std::size_t knot) const {
  return (sampled_->inputs().knot(knot) - start_->t.hi) - start_->t.lo;
}

// Time from the present point to the end of its interval.
double EventSearch::to_next_knot() const {
  if (interval_ + 1 == sampled_->inputs().knots()) return infinity;
  return time_of_knot(interval_ + 1) - certified_;
}

// Sets the prescribed entries of the sampled inputs and the forces on the modes at the present
// point.
void EventSearch::enter_interval() {
  const double tau = at_knot_ ? 0.0 : certified_ - time_of_knot(interval_);
  sampled_->set(interval_, tau, x_);
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    forces_[i] = sampled_->force(static_cast<Eigen::Index>(i), x_);
  }
}

void EventSearch::expand() {
  ++expansions_;
  if (sampled_ != nullptr && march()) return;
  const Flow& flow = *start_->flow;
  const Eigen::Index count = oscillators_needed();
  if (certified_ > 0.0) {
    flow.set_harmonics(start_->t + certified_, x_);
    flow.move_modes(*start_, certified_, flow.frequencies(), count - flow.frequencies(), x_);
  }
  const double t = std::abs(start_->t.hi) + certified_;
  double longest = infinity;
  if (sampled_ != nullptr) {
    enter_interval();
    longest = to_next_knot();
  }

  double certified = infinity;
  double root = infinity;
  need_all_ = false;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    look(i, count, t, longest);
    const WatchState& state = states_[i];
    certified = std::min(certified, state.root < infinity ? state.root : state.certified);
    root = std::min(root, state.root);
  }
  const double together = simultaneous * (t + root);
  if (root < infinity && root <= certified + together) {
    for (WatchState& state : states_) state.fires = state.root <= root + together;
    found_ = true;
    tau_ = certified_ + root;
    return;
  }
  const double resolution = machine_epsilon * t;
  if (!need_all_ && certified <= 0.25 * resolution) {
    // The interval up to the next zero is shorter than the resolution of time.
    for (WatchState& state : states_) state.fires = state.certified <= resolution;
    found_ = true;
    tau_ = certified_;
    return;
  }
  if (sampled_ == nullptr || longest == infinity || certified < longest) {
    certified_ += certified;
    at_knot_ = at_knot_ && certified == 0.0;
    return;
  }
  ++interval_;
  certified_ = time_of_knot(interval_);
  at_knot_ = true;
}

// Value at a knot of the part of a signal by the inputs and the response to them.
double EventSearch::response_at_knot(const Watch& watch, std::size_t knot) const {
  const Signal& signal = *watch.signal;
  const double* y = sampled_->y(knot);
  const double* v = sampled_->v(knot);
  const Eigen::Index first = sampled_->first_mode();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < sampled_->modes(); ++i) {
    sum += signal.p[first + i] * y[i] + signal.r[first + i] * v[i];
  }
  const SampledInputs& inputs = sampled_->inputs();
  for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
    for (Eigen::Index j = 0; j < chain_entries; ++j) {
      const Eigen::Index k = sampled_->first() + chain_entries * c + j;
      if (signal.p[k] == 0.0 && signal.r[k] == 0.0) continue;
      const InputDerivatives d = inputs.at_knot(knot, c);
      sum += signal.p[k] * d[index(2 * j)] + signal.r[k] * d[index(2 * j + 1)];
    }
  }
  return watch.sign * sum;
}

// Bounds |phi''| of the response over a block of intervals.
void EventSearch::set_block(std::size_t number) {
  march_block_ = number;
  const double* second = sampled_->largest_second(number);
  const double* third = sampled_->largest_third(number);
  const double* inputs = sampled_->largest_inputs(number);
  for (std::size_t w = 0; w < states_.size(); ++w) {
    const Signal& signal = *states_[w].watch.signal;
    double sum = 0.0;
    for (Eigen::Index i = 0; i < sampled_->modes(); ++i) {
      const Eigen::Index k = sampled_->first_mode() + i;
      sum += std::abs(signal.p[k]) * second[i] + std::abs(signal.r[k]) * third[i];
    }
    for (Eigen::Index c = 0; c < sampled_->inputs().channels(); ++c) {
      for (Eigen::Index j = 0; j < chain_entries; ++j) {
        const Eigen::Index k = sampled_->first() + chain_entries * c + j;
        const double* of = inputs + chain_terms * c;
        if (2 * j + 2 < chain_terms) sum += std::abs(signal.p[k]) * of[2 * j + 2];
        if (2 * j + 3 < chain_terms) sum += std::abs(signal.r[k]) * of[2 * j + 3];
      }
    }
    marches_[w].second_of_response = sum;
  }
}

// Expands the free part of all signals at the present knot. Returns false if that part does not
// carry over an interval.
bool EventSearch::begin_march() {
  constexpr std::size_t most_intervals = 512;
  constexpr double remainder_share = 0.02;  // of phi, at the end of the march
  const Flow& flow = *start_->flow;
  const SampledInputs& inputs = sampled_->inputs();
  const Eigen::Index count = std::min(oscillators_needed(), flow.frequencies() + flow.modes());
  flow.set_harmonics(start_->t + certified_, x_);
  flow.move_modes(*start_, certified_, flow.frequencies(), count - flow.frequencies(), x_);
  const std::size_t last = std::min(interval_ + most_intervals, inputs.knots() - 2);
  double reach = std::min(time_of_knot(last) - certified_, flow.drives().reach());
  const Point here{flow.oscillators(), flow.drives(), x_, start_->alpha, count, &flow, nullptr};
  march_end_ = -1.0;
  for (std::size_t w = 0; w < states_.size(); ++w) {
    const WatchState& state = states_[w];
    const Signal& signal = *state.watch.signal;
    const Expansion e = expand_free_part(signal, state.watch.sign, state.constant, here);
    const double response = response_at_knot(state.watch, interval_);
    March& m = marches_[w];
    std::copy_n(e.a.begin(), degree + 1, m.a.begin());
    m.a[degree + 1] = e.bound;
    m.noise = 8.0 * e.noise + 16.0 * machine_epsilon * std::abs(response);
    // Modes that are left out are bounded by their whole amplitude.
    m.a[0] -= tail_[w * (index(flow.size()) + 1) + index(count)];
    m.phi = m.a[0] + response;
    if (!(m.phi > m.noise)) return false;
    if (e.bound > 0.0) {
      reach = std::min(reach, rough_root(remainder_share * m.phi / e.bound, degree + 1));
    }
    m.jumps = flow.path() == FlowPath::dense;
    for (Eigen::Index c = 0; c < inputs.channels(); ++c) {
      for (Eigen::Index j = 1; j < chain_entries; ++j) {
        const Eigen::Index k = sampled_->first() + chain_entries * c + j;
        m.jumps = m.jumps || signal.p[k] != 0.0 || signal.r[k] != 0.0;
      }
    }
  }
  if (!(reach >= to_next_knot())) return false;
  for (March& m : marches_) {
    double power = 1.0;
    m.second = 0.0;
    for (int n = 2; n <= degree + 1; ++n) {
      m.second += n * (n - 1) * std::abs(m.a[index(n)]) * power;
      power *= reach;
    }
  }
  march_begin_ = certified_;
  march_end_ = certified_ + reach;
  set_block(interval_ / SampledResponse::block);
  return true;
}

// Whether all signals are positive from the present knot to the knot `to` in the same block. If so,
// moves there.
bool EventSearch::pass(std::size_t to) {
  const double end = time_of_knot(to);
  const double s = end - march_begin_;
  const double length = end - certified_;
  if (interval_ / SampledResponse::block != march_block_) {
    set_block(interval_ / SampledResponse::block);
  }
  for (std::size_t w = 0; w < states_.size(); ++w) {
    March& m = marches_[w];
    double phi = m.a[degree];
    double power = s;
    for (int n = degree - 1; n >= 0; --n) {
      phi = phi * s + m.a[index(n)];
      power *= s;
    }
    m.next = phi + response_at_knot(states_[w].watch, to) - m.a[degree + 1] * power;
    const double sag = 0.125 * length * length * (m.second + m.second_of_response);
    if (!(std::min(m.phi, m.next) > sag + m.noise)) return false;
  }
  for (std::size_t w = 0; w < states_.size(); ++w) {
    marches_[w].phi = marches_[w].next;
    states_[w].predicted = marches_[w].next;
  }
  interval_ = to;
  certified_ = end;
  return true;
}

// Passes intervals without expansions as far as possible. Returns whether it passed any. The inputs
// may jump at the last knot, so that an expansion ends there.
bool EventSearch::march() {
  constexpr int tests_between_looks = 64;
  // A march's bounds would depend on samples after the present time, which may not be known yet.
  if (sampled_->inputs().streamed()) return false;
  const std::size_t last = sampled_->inputs().knots() - 2;
  if (!at_knot_ || !(certified_ > 0.0) || interval_ >= last || states_.empty()) return false;
  if (!(time_of_knot(interval_ + 1) <= march_end_) && !begin_march()) return false;
  const bool single =
      std::any_of(marches_.begin(), marches_.end(), [](const March& m) { return m.jumps; });
  bool passed = false;
  for (int i = 0; i < tests_between_looks && interval_ < last; ++i) {
    constexpr std::size_t block = SampledResponse::block;
    std::size_t stride = std::min({stride_, block - interval_ % block, last - interval_});
    if (single) stride = 1;
    if (time_of_knot(interval_ + stride) > march_end_) {
      if (stride == 1) break;
      stride_ = (stride + 1) / 2;
    } else if (pass(interval_ + stride)) {
      passed = true;
      stride_ = std::min(2 * stride_, block);
    } else {
      if (stride == 1) break;
      stride_ = (stride + 3) / 4;
    }
  }
  return passed;
}

void EventSearch::advance(double tau) {
  constexpr int expansions_between_looks = 64;  // a few microseconds each
  for (int i = 1; !found_ && certified_ <= tau; ++i) {
    expand();
    if (i % expansions_between_looks == 0) check_interrupt();
  }
}

}  // namespace sprag
