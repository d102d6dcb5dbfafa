// Cost of the core: a tick of the replica, the master per unit of time and per impact, an event of
// the estimators, a whole replay. The studies compare a tick with a loop written by hand.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/scene_file.h"
#include "studies/convergence/moreau_replica.h"
#include "studies/convergence/study.h"

namespace {

using namespace sprag;

constexpr double tick = 1e-3;

Scene scene_of(const char* name) {
  return read_scene(std::string(SPRAG_SOURCE_DIR "/scenes/") + name + ".toml");
}

template <Estimator E>
void free_tick(benchmark::State& run) {
  const Scene scene = studies::free_beam(static_cast<int>(run.range(0)));
  E estimator(scene, tick);
  typename E::State state;
  estimator.start(scene.truth.start, 0, 0, state);
  for ([[maybe_unused]] auto _ : run) {
    estimator.tick({}, state);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(free_tick<Replica>)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);
BENCHMARK(free_tick<MoreauReplica>)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);

// The same with the output of q and u at every tick, as the observer publishes them.
void free_tick_with_output(benchmark::State& run) {
  const Scene scene = studies::free_beam(static_cast<int>(run.range(0)));
  Replica replica(scene.model, tick);
  Replica::State state;
  replica.start(scene.truth.start, 0, 0, state);
  Eigen::VectorXd q(scene.truth.start.q.size());
  Eigen::VectorXd u(scene.truth.start.u.size());
  for ([[maybe_unused]] auto _ : run) {
    replica.tick({}, state);
    replica.output(state, q, u);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(free_tick_with_output)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);

class Filter : public TrackingEstimator {
 public:
  Filter(const Scene& scene, double h) : TrackingEstimator(scene, h, EstimatorKind::timing) {}
};

// The master alone, as long as double precision follows the true path.
void master(benchmark::State& run, const char* name, double T) {
  const Scene scene = scene_of(name);
  std::vector<ContactEvent> events;
  long impacts = 0;
  for ([[maybe_unused]] auto _ : run) {
    run.PauseTiming();
    Master machine(scene.model, scene.truth.start);
    (void)machine.flows()[1];
    events.clear();
    run.ResumeTiming();
    machine.advance(at(T), events);
    impacts = machine.impacts();
  }
  using benchmark::Counter;
  const auto inverse_rate = Counter::kIsIterationInvariantRate | Counter::kInvert;
  run.counters["s_per_unit_of_time"] = Counter(T, inverse_rate);
  run.counters["s_per_impact"] = Counter(static_cast<double>(impacts), inverse_rate);
}
BENCHMARK_CAPTURE(master, paper_beam, "paper_beam", 60.0);
BENCHMARK_CAPTURE(master, paper_beam_frame, "paper_beam_frame", 60.0);
BENCHMARK_CAPTURE(master, paper_beam_chatter, "paper_beam_chatter", 60.0);
BENCHMARK_CAPTURE(master, stiff_beam, "stiff_beam", 5.0);

// The events of 20 units of time, repeated, with the flights between them. The few ticks add no
// measurable cost.
template <Estimator E>
void events(benchmark::State& run) {
  Scene scene = studies::paper_beam(static_cast<int>(run.range(0)));
  scene.prior.jitter = static_cast<double>(run.range(1)) * 1e-6;
  Master machine(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  machine.advance(at(20.0), events);
  constexpr double h = 1.0;
  constexpr int ticks = 20;
  E estimator(scene, h);
  typename E::State state;
  for ([[maybe_unused]] auto _ : run) {
    estimator.start(scene.prior.start, 0, 0, state);
    std::span<const ContactEvent> left = events;
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 1; k <= ticks; ++k) {
      std::size_t n = 0;
      while (n < left.size() && left[n].t <= tick_instant(k, h).hi) ++n;
      estimator.tick(left.first(n), state);
      left = left.subspan(n);
    }
    const auto seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin);
    run.SetIterationTime(seconds.count() / static_cast<double>(events.size()));
  }
}
BENCHMARK(events<Replica>)->Args({3, 0})->Args({50, 0})->UseManualTime()->Iterations(200);
BENCHMARK(events<Filter>)
    ->Args({3, 0})
    ->Args({3, 100})
    ->Args({50, 0})
    ->Args({50, 100})
    ->UseManualTime()
    ->Iterations(50);
BENCHMARK(events<TrackingEstimator>)->Args({3, 100})->UseManualTime()->Iterations(200);
BENCHMARK(free_tick<Filter>)->Arg(3)->Arg(10)->Arg(100);

// Output of the filter at a tick, with its standard deviations, as for a row of a states file. A
// chain of n masses with a contact each makes the modes dense. Two matrices of n times 2 n are
// moved.
void row(benchmark::State& run) {
  const Eigen::Index n = run.range(0);
  Scene scene;
  scene.model.M = scene.model.K = Eigen::MatrixXd::Identity(n, n);
  scene.model.K.diagonal().array() += 2.0;
  scene.model.K.diagonal<1>().setConstant(-1.0);
  scene.model.K.diagonal<-1>().setConstant(-1.0);
  scene.model.C = 0.02 * scene.model.M + 0.005 * scene.model.K;
  for (Eigen::Index i = 0; i < n; ++i) {
    scene.model.contacts.push_back({Eigen::VectorXd::Unit(n, i), 1.0, {}, 0.6});
  }
  scene.truth.start =
      scene.prior.start = {Eigen::VectorXd::Constant(n, 0.1), Eigen::VectorXd::Zero(n)};
  scene.prior.start.q *= 1.1;
  Filter filter(scene, tick);
  TrackingState state;
  filter.start(scene.prior.start, 0, 0, state);
  Confidence confidence = filter.no_confidence();
  for ([[maybe_unused]] auto _ : run) {
    filter.tick({}, state);
    filter.confidence(state, confidence);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(row)->Arg(3)->Arg(10)->Arg(30)->Arg(60);

// 100 units of time of the observer's time line at h = 1e-3, with all events known in advance.
void replay(benchmark::State& run) {
  const Scene scene = scene_of("paper_beam");
  Master machine(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  machine.advance(at(100.0), events);
  TrackingEstimator replica(scene, tick, EstimatorKind::replica);
  for ([[maybe_unused]] auto _ : run) {
    TimeLine line(replica, 1, scene.prior.start, 1);
    line.restart(0, 0, 0, no_horizon);
    for (const ContactEvent& event : events) line.receive(event);
    line.set_horizon(100.0);
    line.run(
        0, [](const TrackingState&) {}, [](const TrackingState&) { return true; });
    benchmark::DoNotOptimize(line.handed_out());
  }
}
BENCHMARK(replay)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
