#include <cmath>

#include "sprag/estimation/estimator.h"
#include "sprag/estimation/moreau.h"
#include "sprag/estimation/replica.h"
#include "sprag/files/scene_file.h"
#include "sprag/mechanics/energy.h"
#include "sprag/mechanics/master.h"
#include "studies/studies/study.h"

namespace sprag::studies {
namespace {

constexpr double T = 100.0;

using Events = std::vector<ContactEvent>;

// Each event at the tick that ends its interval, as a program without sub-tick events sees it.
Events snapped(const Events& events, double h) {
  Events late = events;
  for (ContactEvent& event : late) {
    std::int64_t k = last_tick(event.t, h);
    if (tick_instant(k, h).hi < event.t) ++k;
    event.t = tick_instant(k, h).hi;
  }
  return late;
}

template <Estimator E>
State replay(const Scene& scene, const Events& events, double h) {
  E estimator(scene.model, h);
  typename E::State state;
  estimator.start(scene.replica, 0, 0, state);
  auto next = events.begin();
  const std::int64_t last = std::llround(T / h);
  for (std::int64_t k = 1; k <= last; ++k) {
    const auto first = next;
    const double t = tick_instant(k, h).hi;
    while (next != events.end() && next->t <= t) ++next;
    estimator.tick({first, next}, state);
  }
  State end{Eigen::VectorXd(scene.replica.q.size()), Eigen::VectorXd(scene.replica.u.size())};
  estimator.output(state, end.q, end.u);
  return end;
}

// A replica that does what the master does instead of what a clutch does: at a pulse
// u+ = u- - (1 + epsilon) M^-1 w G^-1 gamma-, whatever the sign of gamma-. One contact, pulses.
State copy_impact_map(const Scene& scene, const Events& events, double h) {
  const Flows flows(scene.model);
  const Flow& flow = flows[0];
  const double G = flows.dynamics().G()(0, 0);
  const double epsilon = scene.model.contacts[0].restitution;
  Motion motion;
  Motion shown;
  flow.enter(scene.replica.q, scene.replica.u, at(0.0), Eigen::VectorXd(0), motion);
  shown = motion;
  State end{Eigen::VectorXd(scene.replica.q.size()), Eigen::VectorXd(scene.replica.u.size())};
  auto next = events.begin();
  const std::int64_t last = std::llround(T / h);
  for (std::int64_t k = 1; k <= last; ++k) {
    const Instant t = tick_instant(k, h);
    for (; next != events.end() && next->t <= t.hi; ++next) {
      flow.propagate(motion, at(next->t), motion);
      flow.kick(0, -(1.0 + epsilon) * value(flow.gap_velocity(0), motion) / G, motion);
    }
    flow.propagate(motion, t, shown);
  }
  flow.state(shown, end.q, end.u);
  return end;
}

}  // namespace

void observer(Table& table) {
  const Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  Master master(scene.model, scene.master);
  Events events;
  master.advance(at(T), events);
  State truth = scene.master;
  const ErrorEnergy energy(scene.model);

  const auto measure = [&](const char* method, double h, const auto& run) {
    State end;
    const double seconds = shortest_cpu_time([&] { end = run(); }, 0.2);
    master.state(tick_instant(std::llround(T / h), h), truth.q, truth.u);
    table.add({method, h, energy(truth.q, truth.u, end.q, end.u)[0], 1e6 * seconds / T});
  };
  for (const double h : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
    measure("exact", h, [&] { return replay<Replica>(scene, events, h); });
    measure("Moreau-Jean", h, [&] { return replay<MoreauReplica>(scene, events, h); });
    const Events late = snapped(events, h);
    measure("exact flow with events at ticks", h, [&] { return replay<Replica>(scene, late, h); });
    measure("copied impact map", h, [&] { return copy_impact_map(scene, events, h); });
  }
}

}  // namespace sprag::studies
