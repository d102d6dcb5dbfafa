// Cost of the core: a tick of the replica beside the least work a tick can be (hand-written
// rotation, gap and sign test), the master per unit of time and per impact, a whole replay.
#include <benchmark/benchmark.h>

#include <vector>

#include "mechanics/beam.h"
#include "mechanics/master.h"
#include "mechanics/moreau.h"
#include "mechanics/replica.h"
#include "mechanics/scene.h"
#include "observer/time_line.h"

namespace {

using namespace sprag;

constexpr double tick = 1e-3;

Scene scene_of(const char* name) {
  return read_scene(std::string(SPRAG_SOURCE_DIR "/scenes/") + name + ".toml");
}

// The paper's beam with n modes, in free flight: without its contact, so that the flow of a
// thousand locked modes need not be built.
Model free_beam(int n) {
  const Beam beam{n, 1.0, 1.0, 1.0, 0.17};
  Model model;
  model.M = mass(beam).asDiagonal();
  model.C = damping(beam).asDiagonal();
  model.K = stiffness(beam).asDiagonal();
  const double omega = 9.5;
  model.forces.push_back({inertia_direction(beam), 0.0, {-0.03 * omega * omega, omega, 0.0}});
  return model;
}

State start_of(int n) {
  State state{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n)};
  state.q[0] = -0.05;
  return state;
}

template <typename Stepper>
void free_tick(benchmark::State& run) {
  const int n = static_cast<int>(run.range(0));
  Stepper stepper(free_beam(n), tick);
  typename Stepper::State state;
  stepper.start(start_of(n), 0, 0, state);
  for ([[maybe_unused]] auto _ : run) {
    stepper.tick({}, state);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(free_tick<Replica>)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);
BENCHMARK(free_tick<MoreauReplica>)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);

// The same with q and u written out at every tick, as the observer publishes them.
void free_tick_with_output(benchmark::State& run) {
  const int n = static_cast<int>(run.range(0));
  Replica replica(free_beam(n), tick);
  Replica::State state;
  replica.start(start_of(n), 0, 0, state);
  Eigen::VectorXd q(n);
  Eigen::VectorXd u(n);
  for ([[maybe_unused]] auto _ : run) {
    replica.tick({}, state);
    replica.output(state, q, u);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(free_tick_with_output)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);

// The physical limit: one exact rotation a mode, the gap, its sign. Nothing else.
void hand_written_tick(benchmark::State& run) {
  const auto n = static_cast<std::size_t>(run.range(0));
  const Replica replica(free_beam(static_cast<int>(n)), tick);
  const Oscillators& o = replica.flows()[0].oscillators();
  const TickTable table(o, tick);
  const Eigen::VectorXd w = mode_shapes({static_cast<int>(n), 1.0, 1.0, 1.0, 0.17}, 0.868);
  std::vector<double> zz(n);
  std::vector<double> zv(n);
  std::vector<double> vz(n);
  std::vector<double> vv(n);
  std::vector<double> z(n, 0.01);
  std::vector<double> v(n, 0.01);
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<Eigen::Index>(i) + 1;  // behind the excitation's oscillator
    zz[i] = table.zz[k];
    zv[i] = table.zv[k];
    vz[i] = table.vz[k];
    vv[i] = table.vv[k];
  }
  bool closed = false;
  for ([[maybe_unused]] auto _ : run) {
    double gap = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const double z_new = zz[i] * z[i] + zv[i] * v[i];
      v[i] = vz[i] * z[i] + vv[i] * v[i];
      z[i] = z_new;
      gap += w[static_cast<Eigen::Index>(i)] * z_new;
    }
    closed = closed != (gap < 0.0);
    benchmark::ClobberMemory();
  }
  benchmark::DoNotOptimize(closed);
}
BENCHMARK(hand_written_tick)->Arg(3)->Arg(10)->Arg(100)->Arg(1000);

// Master alone, up to where double precision follows the true path.
void master(benchmark::State& run, const char* name, double T) {
  const Scene scene = scene_of(name);
  std::vector<ContactEvent> events;
  long impacts = 0;
  for ([[maybe_unused]] auto _ : run) {
    run.PauseTiming();
    Master machine(scene.model, scene.master);
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

// 100 units of time of the observer's time line at h = 1e-3, all events known.
void replay(benchmark::State& run) {
  const Scene scene = scene_of("paper_beam");
  Master machine(scene.model, scene.master);
  std::vector<ContactEvent> events;
  machine.advance(at(100.0), events);
  Replica replica(scene.model, tick);
  for ([[maybe_unused]] auto _ : run) {
    TimeLine<Replica> line(replica, 1, scene.replica, 1);
    line.restart(0, 0, 0, no_horizon);
    for (const ContactEvent& event : events) line.receive(event);
    line.set_horizon(100.0);
    line.run(
        0, [](const Replica::State&) {}, [](const Replica::State&) { return true; });
    benchmark::DoNotOptimize(line.handed_out());
  }
}
BENCHMARK(replay)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
