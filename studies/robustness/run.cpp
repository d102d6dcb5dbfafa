#include "studies/robustness/run.h"

#include <cmath>
#include <limits>

#include "sprag/estimation/estimators.h"
#include "sprag/estimation/replica_sweep.h"
#include "sprag/mechanics/energy.h"
#include "sprag/mechanics/master.h"
#include "studies/robustness/forced_replica.h"

namespace sprag::robustness {
namespace {

double or_infinity(double V) {
  return std::isfinite(V) ? V : std::numeric_limits<double>::infinity();
}

template <typename E>
std::vector<double> follow(E& estimator, const State& start, std::span<const ContactEvent> events,
                           const Truth& truth, const Sampling& sampling) {
  const double h = estimator.h();
  const std::int64_t stride = std::llround(sampling.interval / h);
  const ErrorEnergy energy(truth.model);
  typename E::State state;
  estimator.start(start, 0, 0, state);
  State estimate = start;
  std::vector<double> V;
  auto next = events.begin();
  for (std::int64_t k = 1; k <= sampling.last() * stride; ++k) {
    const auto first = next;
    while (next != events.end() && next->t <= tick_instant(k, h).hi) ++next;
    estimator.tick({first, next}, state);
    const Eigen::Index sample = k / stride - sampling.first();
    if (k % stride != 0 || sample < 0) continue;
    estimator.output(state, estimate.q, estimate.u);
    V.push_back(
        or_infinity(energy(truth.q.col(sample), truth.u.col(sample), estimate.q, estimate.u)[0]));
  }
  return V;
}

}  // namespace

std::int64_t Sampling::first() const { return std::llround(0.5 * duration / interval); }

std::int64_t Sampling::last() const { return std::llround(duration / interval); }

Truth simulate(const Scene& scene, const Sampling& sampling) {
  Truth truth{scene.model, {}, {}, {}};
  const Eigen::Index samples = sampling.last() - sampling.first() + 1;
  truth.q.resize(scene.model.coordinates(), samples);
  truth.u.resize(scene.model.coordinates(), samples);
  Master master(scene.model, scene.master);
  const std::int64_t stride = std::llround(sampling.interval / sampling.tick);
  for (Eigen::Index i = 0; i < samples; ++i) {
    const Instant t = tick_instant((sampling.first() + i) * stride, sampling.tick);
    master.advance(t, truth.events);
    master.state(t, truth.q.col(i), truth.u.col(i));
  }
  return truth;
}

std::string name(Method method) {
  switch (method) {
    case Method::replica:
      return "replica";
    case Method::moreau:
      return "Moreau replica";
    case Method::forced:
      return "forced impacts";
    case Method::timing:
      return "timing";
    case Method::both:
      return "both";
    case Method::timing_untold:
      return "timing not told";
    case Method::both_untold:
      return "both not told";
    case Method::timing_drift:
      return "timing with drift";
    default:
      return "both with drift";
  }
}

std::vector<double> error_energies(Method method, Scene believed,
                                   std::span<const ContactEvent> events, const Truth& truth,
                                   const Sampling& sampling) {
  const auto of = [&](auto& estimator) {
    return follow(estimator, believed.replica, events, truth, sampling);
  };
  if (method == Method::timing_drift || method == Method::both_drift) believed.drift = usual_drift;
  if (method == Method::timing_untold || method == Method::both_untold) believed.jitter = 0.0;
  switch (method) {
    case Method::replica: {
      Replica estimator(believed.model, sampling.tick);
      return of(estimator);
    }
    case Method::moreau: {
      MoreauReplica estimator(believed.model, sampling.moreau_tick);
      return of(estimator);
    }
    case Method::forced: {
      ForcedReplica estimator(believed.model, sampling.tick);
      return of(estimator);
    }
    case Method::timing:
    case Method::timing_untold:
    case Method::timing_drift: {
      TimingFilter estimator(believed.model, sampling.tick, uncertainty_of(believed));
      return of(estimator);
    }
    default: {
      SupervisedFilter estimator(believed.model, sampling.tick, uncertainty_of(believed));
      return of(estimator);
    }
  }
}

std::vector<std::vector<double>> replica_energies(std::span<const Told> runs,
                                                  std::span<const Truth> truths,
                                                  const Sampling& sampling) {
  const std::int64_t stride = std::llround(sampling.interval / sampling.tick);
  std::vector<ReplicaSweep::Run> lanes;
  std::vector<ErrorEnergy> energies;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    lanes.push_back({std::make_shared<Flows>(runs[i].believed.model), runs[i].believed.replica,
                     runs[i].events});
    energies.emplace_back(truths[i].model);
  }
  ReplicaSweep sweep(lanes, sampling.tick);
  std::vector<std::vector<double>> V(runs.size());
  for (std::int64_t sample = sampling.first(); sample <= sampling.last(); ++sample) {
    sweep.run(sample * stride);
    const Eigen::Index column = sample - sampling.first();
    for (std::size_t i = 0; i < runs.size(); ++i) {
      State estimate = runs[i].believed.replica;
      sweep.output(i, estimate.q, estimate.u);
      V[i].push_back(or_infinity(energies[i](truths[i].q.col(column), truths[i].u.col(column),
                                             estimate.q, estimate.u)[0]));
    }
  }
  return V;
}

}  // namespace sprag::robustness
