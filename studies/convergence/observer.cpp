#include <array>
#include <cmath>

#include "sprag/detail/analysis/quantile.h"
#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "studies/common/disturbance.h"
#include "studies/convergence/moreau_replica.h"
#include "studies/convergence/study.h"

namespace sprag::studies {
namespace {

constexpr double T = 100.0;
constexpr std::array spans{20.0, T};
// V is the median of samples at this distance before the end of a span [s].
constexpr double sample = 0.1, window = 2.0;

using Events = std::vector<ContactEvent>;

// Moves each event to the tick that ends its interval, like a program without sub-tick events.
Events snapped(const Events& events, double h) {
  Events late = events;
  for (ContactEvent& event : late) {
    std::int64_t k = last_tick(event.t, h);
    if (tick_instant(k, h).hi < event.t) ++k;
    event.t = tick_instant(k, h).hi;
  }
  return late;
}

using States = std::array<std::vector<State>, spans.size()>;

// The ticks whose states are kept: those of the last two units of time before each span's end.
template <typename Keep>
void keep_ends(std::int64_t k, double h, const Keep& keep) {
  const double t = static_cast<double>(k) * h;
  for (std::size_t i = 0; i < spans.size(); ++i) {
    const auto every = std::max<std::int64_t>(std::llround(sample / h), 1);
    if (t > spans[i] - window && t < spans[i] + h / 2 && k % every == 0) keep(i);
  }
}

template <Estimator E, typename... Kind>
void replay(const Scene& scene, const Events& events, double h, States* ends, Kind... kind) {
  E estimator(scene, h, kind...);
  typename E::State state;
  State end{Eigen::VectorXd(scene.prior.start.q.size()),
            Eigen::VectorXd(scene.prior.start.u.size())};
  estimator.start(scene.prior.start, 0, 0, state);
  auto next = events.begin();
  const std::int64_t last = std::llround(T / h);
  for (std::int64_t k = 1; k <= last; ++k) {
    const auto first = next;
    const double t = tick_instant(k, h).hi;
    while (next != events.end() && next->t <= t) ++next;
    estimator.tick({first, next}, state);
    if (ends == nullptr) continue;
    keep_ends(k, h, [&](std::size_t i) {
      estimator.output(state, end.q, end.u);
      (*ends)[i].push_back(end);
    });
  }
}

// A replica with the master's impact map instead of the clutch: at a pulse
// u+ = u- - (1 + epsilon) M^-1 w G^-1 gamma-, for either sign of gamma-. One contact, pulses.
void copy_impact_map(const Scene& scene, const Events& events, double h, States* ends) {
  const Flows flows(scene.model);
  const Flow& flow = flows[0];
  const double G = flows.dynamics().G()(0, 0);
  const double epsilon = scene.model.contacts[0].restitution;
  Motion motion;
  Motion shown;
  flow.enter(scene.prior.start.q, scene.prior.start.u, at(0.0), Eigen::VectorXd(0), motion);
  shown = motion;
  State end{Eigen::VectorXd(scene.prior.start.q.size()),
            Eigen::VectorXd(scene.prior.start.u.size())};
  auto next = events.begin();
  const std::int64_t last = std::llround(T / h);
  for (std::int64_t k = 1; k <= last; ++k) {
    const Instant t = tick_instant(k, h);
    for (; next != events.end() && next->t <= t.hi; ++next) {
      flow.propagate(motion, at(next->t), motion);
      flow.kick(0, -(1.0 + epsilon) * value(flow.gap_velocity(0), motion) / G, motion);
    }
    flow.propagate(motion, t, shown);
    if (ends == nullptr) continue;
    keep_ends(k, h, [&](std::size_t i) {
      flow.state(shown, end.q, end.u);
      (*ends)[i].push_back(end);
    });
  }
}

// The machine's own states at those ticks.
States true_ends(const Scene& scene, double h) {
  Master master(scene.model, scene.truth.start);
  Events ignored;
  State here = scene.truth.start;
  States ends;
  for (std::int64_t k = 1; k <= std::llround(T / h); ++k) {
    keep_ends(k, h, [&](std::size_t i) {
      master.advance(tick_instant(k, h), ignored);
      master.state(tick_instant(k, h), here.q, here.u);
      ends[i].push_back(here);
    });
  }
  return ends;
}

double median_V(const ErrorEnergy& energy, const std::vector<State>& truth,
                const std::vector<State>& estimates) {
  std::vector<double> V;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    V.push_back(energy(truth[i].q, truth[i].u, estimates[i].q, estimates[i].u)[0]);
  }
  return quantile(std::move(V), 0.5);
}

}  // namespace

void observer(Table& table) {
  Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  Events exact;
  Master(scene.model, scene.truth.start).advance(at(T), exact);
  const ErrorEnergy energy(scene.model);

  for (const double jitter : {0.0, 1e-4}) {
    scene.prior.jitter = jitter;
    const Events events = common::disturb(exact, {.jitter = jitter}, 1, T, 1);
    for (const double h : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
      const States truth = true_ends(scene, h);
      const auto measure = [&](const char* method, const auto& run) {
        States ends;
        run(&ends);
        const double seconds = shortest_cpu_time([&] { run(nullptr); }, 0.2);
        table.add({method, jitter, h, median_V(energy, truth[0], ends[0]),
                   median_V(energy, truth[1], ends[1]), 1e6 * seconds / T});
      };
      const Events late = snapped(events, h);
      measure("exact replica", [&](States* ends) { replay<Replica>(scene, events, h, ends); });
      for (const auto& [name, kind] : {std::pair("event filter", EstimatorKind::timing),
                                       std::pair("both", EstimatorKind::both)}) {
        measure(name, [&, kind = kind](States* ends) {
          replay<TrackingEstimator>(scene, events, h, ends, kind);
        });
      }
      measure("Moreau-Jean replica",
              [&](States* ends) { replay<MoreauReplica>(scene, events, h, ends); });
      measure("replica with events at ticks",
              [&](States* ends) { replay<Replica>(scene, late, h, ends); });
      measure("copied impact map", [&](States* ends) { copy_impact_map(scene, events, h, ends); });
    }
  }
}

}  // namespace sprag::studies
