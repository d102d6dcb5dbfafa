#include "studies/calibration/study.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/analysis/quantile.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/energy.h"
#include "studies/calibration/machines.h"
#include "studies/common/random.h"

namespace sprag::calibration {
namespace {

constexpr double usual_ticks = 20000.0;
constexpr std::size_t enough_events = 2500;
constexpr Eigen::Index large = 40;  // coordinates
constexpr int fewer_seeds = 5;
constexpr int most_draws = 1000;
constexpr double troubled_share = 0.1;
constexpr double much_worse = 10.0;
constexpr double rounding = 1e-20;  // of V, over V at the start

// Seeds for draws that are independent of the disturbance's draws.
std::uint64_t other_seed(int seed, int purpose) {
  return 1000000 * static_cast<std::uint64_t>(purpose) + static_cast<std::uint64_t>(seed);
}

double duration_of(const Scene& scene) {
  const double T = usual_duration(scene.model);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  return master.advance(at(T), events, enough_events) ? T : to_digits(events.back().t, 2);
}

double or_infinity(double V) { return std::isfinite(V) ? V : infinity; }

bool in_second_half(Eigen::Index sample, const Truth& truth) {
  return 2 * (sample + 1) > truth.q.cols();
}

}  // namespace

Trial follow(EstimatorKind kind, const Scene& given, const Scene& machine,
             std::span<const ContactEvent> events, const Truth& truth,
             const std::vector<double>& V_replica) {
  const Eigen::Index f = given.model.coordinates();
  const auto& contacts = given.model.contacts;
  TrackingEstimator estimator(given, truth.tick, kind);
  const ErrorEnergy energy(machine.model);
  const double start = energy(machine.truth.start.q, machine.truth.start.u, given.prior.start.q,
                              given.prior.start.u)[0];
  TrackingState state;
  estimator.start(given.prior.start, 0, 0, state);
  Confidence confidence = estimator.no_confidence();
  Eigen::VectorXd q(f), u(f);
  Trial trial;
  std::vector<double> V;
  std::int64_t count = 0;
  const auto on_tick = [&](std::int64_t k) {
    const std::int64_t fresh = state.window.events - count;
    count = state.window.events;
    if (fresh == 0 || state.track.status == TrackStatus::lost) return;
    if (2 * k <= truth.q.cols() * truth.stride) return;
    trial.innovations += state.belief->square;
    ++trial.innovation_count;
  };
  const auto on_sample = [&](Eigen::Index sample) {
    estimator.output(state, q, u);
    estimator.confidence(state, confidence);
    const Eigen::VectorXd off_q = q - truth.q.col(sample);
    const Eigen::VectorXd off_u = u - truth.u.col(sample);
    const double now = or_infinity(energy(truth.q.col(sample), truth.u.col(sample), q, u)[0]);
    const double samples = static_cast<double>(truth.q.cols());
    if (now > rounding * start && now > much_worse * V_replica[static_cast<std::size_t>(sample)]) {
      trial.worse += 1.0 / samples;
    }
    if (confidence.from_filter) trial.from_filter += 1.0 / samples;
    if (!in_second_half(sample, truth)) return;
    V.push_back(now);
    for (Eigen::Index i = 0; i < f; ++i) {
      trial.state.add(off_q[i], confidence.sigma_q[i]);
      trial.state.add(off_u[i], confidence.sigma_u[i]);
    }
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      trial.gaps.add(contacts[i].w.dot(off_q), confidence.sigma_g[static_cast<Eigen::Index>(i)]);
    }
  };
  run(estimator, state, events, truth, on_tick, on_sample);
  const std::vector<double> of_replica(V_replica.end() - static_cast<std::ptrdiff_t>(V.size()),
                                       V_replica.end());
  trial.inconsistencies = confidence.inconsistencies;
  trial.V = quantile(V, 0.5);
  trial.V_largest = *std::max_element(V.begin(), V.end());
  trial.V_replica = quantile(of_replica, 0.5);
  trial.V_replica_largest = *std::max_element(of_replica.begin(), of_replica.end());
  return trial;
}

namespace {

// A random start: `start` plus an error with the covariance of `uncertainty`.
State drawn(const State& start, const Uncertainty& uncertainty, common::Random& random) {
  const auto draw = [&](const Eigen::MatrixXd& S) {
    Eigen::VectorXd normal(S.cols());
    for (double& one : normal) one = random.normal();
    return Eigen::VectorXd(S * normal);
  };
  Eigen::VectorXd q = start.q + draw(uncertainty.q);
  return {std::move(q), start.u + draw(uncertainty.u)};
}

Scene with_start_of_prior(Scene scene, std::uint64_t seed) {
  common::Random random(seed);
  scene.prior.start = drawn(scene.truth.start, uncertainty_of(scene), random);
  return scene;
}

bool is_inside(const Model& model, const Eigen::VectorXd& q) {
  return std::any_of(model.contacts.begin(), model.contacts.end(),
                     [&](const Contact& contact) { return gap(contact, q, 0.0) < 0.0; });
}

// Draws again until the machine starts outside its supports.
Scene with_machine_of_prior(Scene scene, std::uint64_t seed) {
  common::Random random(seed);
  const Uncertainty uncertainty = uncertainty_of(scene);
  for (int i = 0; i < most_draws; ++i) {
    scene.truth.start = drawn(scene.prior.start, uncertainty, random);
    if (!is_inside(scene.model, scene.truth.start.q)) return scene;
  }
  throw std::invalid_argument(scene.name + ": the specified start is inside the supports");
}

// One parameter off by 1 to 5 % with a random sign; a phase by 0.01 to 0.05 rad.
Scene with_wrong_parameter(Scene scene, std::uint64_t seed) {
  using Kind = Unknown::Kind;
  common::Random random(seed);
  std::vector<Unknown> parameters = unknowns_of(scene);
  std::erase_if(parameters, [](const Unknown& one) {
    return one.kind == Kind::delay || (one.nominal == 0.0 && one.kind != Kind::phase);
  });
  const auto chosen =
      static_cast<std::size_t>(random.uniform() * static_cast<double>(parameters.size()));
  const Unknown& parameter = parameters[chosen];
  const double share = (random.uniform() < 0.5 ? -1.0 : 1.0) * (0.01 + 0.04 * random.uniform());
  const double size = parameter.kind == Kind::phase ? 1.0 : parameter.nominal;
  double value = parameter.nominal + share * size;
  if (parameter.upper_limit > 0.0) value = std::min(value, parameter.upper_limit);
  return with(scene, parameter, value);
}

Scene reported_of(const Scene& scene, double jitter, const Options& options, int seed) {
  Scene given = scene;
  if (options.start == Start::prior) given = with_start_of_prior(given, other_seed(seed, 1));
  if (options.trouble == Trouble::wrong) given = with_wrong_parameter(given, other_seed(seed, 2));
  given.prior.jitter = jitter;
  return given;
}

Disturbance disturbance(double jitter, Trouble trouble, const Truth& truth, std::size_t contacts) {
  Disturbance all;
  all.jitter = jitter;
  if (trouble == Trouble::missing || trouble == Trouble::mixed) all.lost = troubled_share;
  if (trouble == Trouble::spurious || trouble == Trouble::mixed) {
    const auto each = static_cast<double>(truth.events.size()) / static_cast<double>(contacts);
    all.spurious = troubled_share * each / truth.duration;
  }
  return all;
}

}  // namespace

Truth simulate(const Scene& scene, const Options& options) {
  Truth truth;
  truth.duration = options.duration > 0.0 ? options.duration : duration_of(scene);
  if (!(truth.duration > 0.0)) {
    throw std::invalid_argument(scene.name + ": nothing in it has a period: give --duration");
  }
  truth.tick = options.tick > 0.0 ? options.tick : to_digits(truth.duration / usual_ticks, 1);
  const std::int64_t ticks = last_tick(truth.duration, truth.tick);
  truth.stride = std::max<std::int64_t>(ticks / options.samples, 1);
  const Eigen::Index samples = ticks / truth.stride;
  if (samples < 2) throw std::invalid_argument(scene.name + ": fewer than two ticks");
  truth.q.resize(scene.model.coordinates(), samples);
  truth.u.resize(scene.model.coordinates(), samples);
  Master master(scene.model, scene.truth.start);
  for (Eigen::Index i = 0; i < samples; ++i) {
    const Instant t = tick_instant((i + 1) * truth.stride, truth.tick);
    master.advance(t, truth.events);
    master.state(t, truth.q.col(i), truth.u.col(i));
  }
  return truth;
}

std::vector<double> follow_replica(const Scene& given, const Scene& machine,
                                   std::span<const ContactEvent> events, const Truth& truth) {
  Replica replica(given.model, truth.tick);
  const ErrorEnergy energy(machine.model);
  Replica::State state;
  replica.start(given.prior.start, 0, 0, state);
  Eigen::VectorXd q(given.model.coordinates()), u(q.size());
  std::vector<double> V;
  run(
      replica, state, events, truth, [](std::int64_t) {},
      [&](Eigen::Index sample) {
        replica.output(state, q, u);
        V.push_back(or_infinity(energy(truth.q.col(sample), truth.u.col(sample), q, u)[0]));
      });
  return V;
}

namespace {

// A machine and its simulated run.
struct Path {
  Scene machine;
  Truth truth;
};

// One per seed, as long as `of_scene`.
std::vector<Path> drawn_paths(const Scene& scene, const Truth& of_scene, Options options,
                              int seeds) {
  options.duration = of_scene.duration;
  options.tick = of_scene.tick;
  std::vector<Path> paths(static_cast<std::size_t>(seeds));
  in_parallel(options.threads, seeds, [&](int i) {
    Scene machine = with_machine_of_prior(scene, other_seed(i + 1, 3));
    Truth truth = simulate(machine, options);
    paths[static_cast<std::size_t>(i)] = {std::move(machine), std::move(truth)};
  });
  return paths;
}

}  // namespace

void study(const Scene& scene, const std::vector<double>& jitters,
           const std::vector<EstimatorKind>& estimators, const Options& options,
           const std::function<void(const Row&)>& on_row) {
  const Truth truth = simulate(scene, options);
  const auto contacts = static_cast<int>(scene.model.contacts.size());
  const bool is_large = scene.model.coordinates() > large;
  const int seeds = is_large ? std::max(options.seeds / fewer_seeds, 1) : options.seeds;
  const std::vector<Path> paths = options.start == Start::machine
                                      ? drawn_paths(scene, truth, options, seeds)
                                      : std::vector<Path>{{scene, truth}};
  for (const double jitter : jitters) {
    std::vector<std::vector<Trial>> trials(estimators.size(),
                                           std::vector<Trial>(static_cast<std::size_t>(seeds)));
    in_parallel(options.threads, seeds, [&](int i) {
      const auto& [machine, path] = paths[static_cast<std::size_t>(i) % paths.size()];
      Scene given = reported_of(machine, jitter, options, i + 1);
      given.prior.confidence = options.confidence;
      const auto events = common::disturb(
          path.events, disturbance(jitter, options.trouble, path, machine.model.contacts.size()),
          contacts, path.duration, static_cast<std::uint64_t>(i) + 1);
      const std::vector<double> V_replica = follow_replica(given, machine, events, path);
      for (std::size_t j = 0; j < estimators.size(); ++j) {
        trials[j][static_cast<std::size_t>(i)] =
            follow(estimators[j], given, machine, events, path, V_replica);
      }
    });
    for (std::size_t j = 0; j < estimators.size(); ++j) {
      Row row;
      row.scene = scene.name;
      row.estimator = estimators[j];
      row.coordinates = scene.model.coordinates();
      row.contacts = contacts;
      row.jitter = jitter;
      row.omega_sigma = highest_frequency(scene.model) * jitter;
      row.duration = truth.duration;
      row.tick = truth.tick;
      row.events = truth.events.size();
      row.seeds = seeds;
      row.summary = summarize(trials[j]);
      if (options.trouble == Trouble::none) row.missed = missed_bars(row.summary, row.omega_sigma);
      on_row(row);
    }
  }
}

}  // namespace sprag::calibration
