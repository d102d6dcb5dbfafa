#include "python/src/trial.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "python/src/random.h"
#include "sprag/detail/live/machine_adaptation.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/reduction.h"

namespace sprag::python {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();
constexpr double usual_threshold = 1e-4;  // of V at the start
constexpr double near_floor = 10.0;
constexpr double much_worse = 10.0;
constexpr double rounding = 1e-20;  // of V at the start

double median(std::vector<double> values) {
  if (values.empty()) return undefined;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  const double above = *middle;
  return 0.5 * (*std::max_element(values.begin(), middle) + above);
}

// The settled samples: the second half of V.
std::vector<double>::const_iterator settled(const std::vector<double>& V) {
  return V.begin() + static_cast<std::ptrdiff_t>((V.size() - 1) / 2 + 1);
}

// Sum of the squared errors over their standard deviations. Infinite standard deviations, which
// claim nothing, are left out.
struct NormalizedSquares {
  double sum = 0.0;
  std::int64_t count = 0, beyond = 0;

  void add(double error, double sigma) {
    if (!std::isfinite(sigma)) return;
    const double z = error / sigma;
    sum += z * z;
    ++count;
    if (!(std::abs(z) <= 3.0)) ++beyond;
  }
};

double error_energy(const ErrorEnergy& energy, const Truth& truth, Eigen::Index sample,
                    const Eigen::VectorXd& q, const Eigen::VectorXd& u) {
  const double V = energy(truth.q.col(sample), truth.u.col(sample), q, u)[0];
  return std::isfinite(V) ? V : infinite;
}

// Figures that follow from V alone; `interval` between samples.
Figures figures_of(std::vector<double> samples, double interval, double threshold) {
  Figures figures;
  figures.V = std::move(samples);
  const std::vector<double>& V = figures.V;
  figures.V_floor = median({settled(V), V.cend()});
  figures.V_max = *std::max_element(settled(V), V.cend());
  const auto time_of = [&](std::vector<double>::const_iterator at_sample) {
    return static_cast<double>(at_sample - V.begin()) * interval;
  };
  const double limit = threshold > 0.0 ? threshold : usual_threshold * V.front();
  const auto below =
      std::find_if(V.cbegin(), V.cend(), [&](double value) { return value < limit; });
  figures.time_below = below == V.cend() ? infinite : time_of(below);
  auto landed = std::find_if(V.cbegin() + 1, V.cend(),
                             [&](double value) { return value <= near_floor * figures.V_floor; });
  if (landed == V.cend()) --landed;
  figures.rate = std::log(V.front() / *landed) / time_of(landed);
  figures.nees = figures.beyond_3_sigma = figures.trusted = undefined;
  return figures;
}

// A random state with this error energy; its direction is uniform on a sphere in the norm of (23)
// of Baumann & Leine 2014.
State drawn_offset(const Model& model, double energy, Random& random) {
  const NaturalModes modes = natural_modes(model);
  const Eigen::Index f = model.coordinates();
  Eigen::VectorXd eta = Eigen::VectorXd::Zero(f), eta_dot(f);
  double squares = 0.0;
  for (Eigen::Index i = 0; i < f; ++i) {
    const double of_q = random.normal();
    const double of_u = random.normal();
    // A rigid motion has no potential energy.
    if (modes.stiffness[i] > 0.0) {
      eta[i] = of_q / std::sqrt(modes.stiffness[i]);
      squares += of_q * of_q;
    }
    eta_dot[i] = of_u / std::sqrt(modes.mass[i]);
    squares += of_u * of_u;
  }
  const double scale = std::sqrt(2.0 * energy / squares);
  return {scale * (modes.Phi * eta), scale * (modes.Phi * eta_dot)};
}

bool outside(const Scene& scene) {
  return std::all_of(
      scene.model.contacts.begin(), scene.model.contacts.end(),
      [&](const Contact& contact) { return gap(contact, scene.truth.start.q, 0.0) >= 0.0; });
}

}  // namespace

void draw_starts(std::uint64_t seed, std::uint64_t stream, double of_machine,
                 std::optional<double> of_replica, Scene& machine, Scene& observer) {
  State& start = machine.truth.start;
  if (of_machine > 0.0) {
    const State center = start;
    constexpr int attempts = 1000;
    Random random(seed, stream, Purpose::start_of_machine);
    for (int attempt = 0;; ++attempt) {
      if (attempt == attempts)
        throw Error("no start of the machine outside its supports was drawn");
      const State offset = drawn_offset(machine.model, of_machine, random);
      start = {center.q + offset.q, center.u + offset.u};
      if (machine.truth.release_penetration || outside(machine)) break;
    }
    machine.truth.given = true;
  }
  const Eigen::Index f = observer.model.coordinates();
  if (of_replica) {
    Random random(seed, stream, Purpose::start_of_replica);
    const State offset = drawn_offset(machine.model, *of_replica, random);
    observer.prior.start = {(start.q + offset.q).head(f), (start.u + offset.u).head(f)};
  }
  observer.truth.start = {start.q.head(f), start.u.head(f)};
}

std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed, std::uint64_t stream) {
  return sprag::disturb(events, disturbance, contacts, end, Random(seed, stream, Purpose::jitter),
                        Random(seed, stream, Purpose::losses),
                        Random(seed, stream, Purpose::spurious));
}

Truth run_machine(const Scene& machine, double duration, double tick, int samples) {
  Truth truth{machine.model, {}, tick, 1, duration, {}, {}};
  std::int64_t count = samples;
  if (tick > 0.0) {
    const std::int64_t ticks = last_tick(duration, tick);
    truth.stride = std::max<std::int64_t>(ticks / samples, 1);
    count = ticks / truth.stride;
  } else {
    truth.tick = duration / samples;
  }
  if (count < 2) throw Error("the duration has fewer than two ticks");
  truth.q.resize(machine.model.coordinates(), count + 1);
  truth.u.resize(machine.model.coordinates(), count + 1);
  Master master(machine.model, machine.truth.start);
  for (Eigen::Index i = 0; i <= count; ++i) {
    const Instant t = tick_instant(i * truth.stride, truth.tick);
    master.advance(t, truth.events);
    master.state(t, truth.q.col(i), truth.u.col(i));
  }
  master.advance(at(duration), truth.events);
  return truth;
}

void pursue(
    TrackingEstimator& estimator, const State& start, std::span<const ContactEvent> events,
    const Truth& truth,
    const std::function<void(Eigen::Index sample, const TrackingEstimator::State& state)>& visit) {
  TrackingEstimator::State state;
  std::optional<MachineAdaptation> adaptation;
  if (estimator.family() != nullptr) adaptation.emplace(estimator);
  if (adaptation) adaptation->start(0.0, 0);
  estimator.start(start, 0, 0, state);
  auto next = events.begin();
  const auto up_to = [&](std::int64_t k) {
    const auto first = next;
    while (next != events.end() && next->t <= tick_instant(k, truth.tick).hi) ++next;
    return std::span<const ContactEvent>(first, next);
  };
  auto events_of_tick = up_to(0);
  if (!events_of_tick.empty()) estimator.apply(events_of_tick, state);
  visit(0, state);
  const std::int64_t last = truth.samples() * truth.stride;
  for (std::int64_t k = 1; k <= last; ++k) {
    check_interrupt();
    if (adaptation && adaptation->settle(events_of_tick, state)) adaptation->identify(state);
    events_of_tick = up_to(k);
    estimator.tick(events_of_tick, state);
    if (k % truth.stride == 0) visit(k / truth.stride, state);
  }
}

Figures follow(EstimatorKind kind, const Scene& scene, std::span<const ContactEvent> events,
               const Truth& truth, double threshold) {
  TrackingEstimator estimator(scene, truth.tick, kind);
  const bool filter = kind != EstimatorKind::replica;
  const ErrorEnergy energy(truth.model);
  Confidence confidence = estimator.no_confidence();
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  std::vector<double> V;
  NormalizedSquares squares;
  std::int64_t trusted = 0;
  const auto take = [&](Eigen::Index i, const TrackingEstimator::State& state) {
    estimator.output(state, q, u);
    V.push_back(error_energy(energy, truth, i, q, u));
    if (!filter) return;
    estimator.confidence(state, confidence);
    if (i > 0 && confidence.from_filter) ++trusted;
    if (2 * i <= truth.samples()) return;
    for (Eigen::Index j = 0; j < f; ++j) {
      squares.add(q[j] - truth.q(j, i), confidence.sigma_q[j]);
      squares.add(u[j] - truth.u(j, i), confidence.sigma_u[j]);
    }
  };
  pursue(estimator, scene.prior.start, events, truth, take);

  Figures figures = figures_of(std::move(V), truth.interval(), threshold);
  if (filter) {
    const auto count = static_cast<double>(squares.count);
    figures.nees = squares.sum / count;
    figures.beyond_3_sigma = static_cast<double>(squares.beyond) / count;
    figures.trusted = static_cast<double>(trusted) / static_cast<double>(truth.samples());
  }
  return figures;
}

void add_worse(std::span<const EstimatorKind> kinds, std::span<Figures> figures) {
  const auto replica = std::find(kinds.begin(), kinds.end(), EstimatorKind::replica);
  if (replica == kinds.end()) return;
  const auto of_replica = static_cast<std::size_t>(replica - kinds.begin());
  const std::vector<double>& V_replica = figures[of_replica].V;
  const double least = rounding * V_replica.front();
  for (std::size_t e = 0; e < figures.size(); ++e) {
    if (e == of_replica) continue;
    const std::vector<double>& V = figures[e].V;
    std::ptrdiff_t worse = 0;
    const auto first = settled(V) - V.begin();
    for (std::size_t i = static_cast<std::size_t>(first); i < V.size(); ++i) {
      if (V[i] > least && V[i] > much_worse * V_replica[i]) ++worse;
    }
    figures[e].worse = static_cast<double>(worse) / static_cast<double>(V.cend() - settled(V));
  }
}

}  // namespace sprag::python
