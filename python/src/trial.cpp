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

// Runs an estimator from `start` with the events as they arrive, tick by tick, and calls
// visit(sample, state) at every sample. Identifications of an adaptive estimator are computed at
// once.
template <typename Visit>
void pursue(TrackingEstimator& estimator, const State& start, std::span<const ContactEvent> events,
            const Truth& truth, const Visit& visit) {
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

Figures follow(EstimatorKind kind, const Scene& scene, std::span<const ContactEvent> events,
               const Truth& truth) {
  TrackingEstimator estimator(scene, truth.tick, kind);
  const bool filter = kind != EstimatorKind::replica;
  const ErrorEnergy energy(truth.model);
  Confidence confidence = estimator.no_confidence();
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  Figures figures;
  NormalizedSquares squares;
  std::int64_t trusted = 0;
  const auto take = [&](Eigen::Index i, const TrackingEstimator::State& state) {
    estimator.output(state, q, u);
    figures.V.push_back(error_energy(energy, truth, i, q, u));
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

  if (filter) {
    const auto count = static_cast<double>(squares.count);
    figures.nees = squares.sum / count;
    figures.beyond_3_sigma = static_cast<double>(squares.beyond) / count;
    figures.trusted = static_cast<double>(trusted) / static_cast<double>(truth.samples());
  }
  return figures;
}

}  // namespace sprag::python
