#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sprag/detail/replica/replica_sweep.h"
#include "sprag/detail/study/trial.h"
#include "sprag/master.h"
#include "studies/convergence/study.h"

namespace sprag::studies {
namespace {

constexpr double T = 20.0;
constexpr int turns = 9;

// Every tick as in another program, with the events of its interval.
void run_alone(const ReplicaSweep::Run& run, double h, Replica& replica, Replica::State& state) {
  std::span<const ContactEvent> left = run.events;
  replica.start(run.start, 0, 0, state);
  for (std::int64_t k = 1; k <= run.ticks; ++k) {
    std::size_t due = 0;
    while (due < left.size() && left[due].t <= tick_instant(k, h).hi) ++due;
    replica.tick(left.first(due), state);
    left = left.subspan(due);
  }
}

// Eight replicas with their own parameters and starts, with the events of their masters or in free
// flight.
void measure(int modes, bool impacts, double h, Table& table) {
  const std::int64_t ticks = std::llround(T / h);
  std::vector<std::vector<ContactEvent>> events(ReplicaSweep::lanes);
  std::vector<ReplicaSweep::Run> runs;
  std::vector<std::unique_ptr<Replica>> replicas;
  for (std::size_t l = 0; l < ReplicaSweep::lanes; ++l) {
    Scene scene = impacts ? paper_beam(modes) : free_beam(modes);
    scene.model.K *= 1.0 + 1e-3 * static_cast<double>(l);
    scene.truth.start.q *= 1.0 + 1e-2 * static_cast<double>(l);
    if (impacts) Master(scene.model, scene.truth.start).advance(at(T), events[l]);
    runs.push_back({std::make_shared<Flows>(scene.model), scene.prior.start, events[l], 0, ticks});
    replicas.push_back(std::make_unique<Replica>(runs[l].flows, h));
  }
  Replica::State state;
  const double each = 1e9 / static_cast<double>(ticks * static_cast<std::int64_t>(runs.size()));
  for (int turn = 1; turn <= turns; ++turn) {
    ReplicaSweep together(runs, h);
    double begin = common::cpu_seconds();
    together.run(ticks);
    const double of_sweep = common::cpu_seconds() - begin;
    begin = common::cpu_seconds();
    for (std::size_t l = 0; l < runs.size(); ++l) run_alone(runs[l], h, *replicas[l], state);
    const double of_singles = common::cpu_seconds() - begin;
    table.add(
        {double(modes), double(impacts), h, double(turn), each * of_sweep, each * of_singles});
  }
}

}  // namespace

void sweep(Table& table) {
  for (const int modes : {3, 10}) {
    measure(modes, false, 1e-3, table);
    // The tick determines the share of the impacts in the cost.
    for (const double h : {1e-3, 1e-4}) measure(modes, true, h, table);
  }
}

void side_by_side(Table& table) {
  constexpr int runs = 4 * static_cast<int>(ReplicaSweep::lanes);
  for (const int modes : {3, 10}) {
    const Scene machine = paper_beam(modes);
    for (const double tick : {1e-2, 1e-3, 1e-4}) {
      const study::Truth truth = study::run_machine(machine, 100.0, tick, 100);
      std::vector<Scene> scenes(runs, machine);
      std::vector<study::EstimatorInput> inputs;
      for (int i = 0; i < runs; ++i) {
        Scene& scene = scenes[static_cast<std::size_t>(i)];
        scene.model.contacts[0].restitution *= 1.0 + 1e-3 * i;
        scene.prior.start.q *= 1.0 + 1e-2 * i;
        inputs.push_back({scene, truth.events, truth});
      }
      for (int turn = 1; turn <= turns; ++turn) {
        double begin = common::cpu_seconds();
        if (study::follow_replicas(inputs, 0.0).back()->V.empty()) throw Error("no run");
        const double together = common::cpu_seconds() - begin;
        begin = common::cpu_seconds();
        for (const study::EstimatorInput& run : inputs) {
          follow(EstimatorKind::replica, run.scene, run.events, run.truth, 0.0);
        }
        const double alone = common::cpu_seconds() - begin;
        table.add({double(modes), tick, double(turn), 1e6 * together / runs, 1e6 * alone / runs});
      }
    }
  }
}

}  // namespace sprag::studies
