// Permanently lost records: the run reports them, continues and converges.
#include <gtest/gtest.h>

#include <iostream>

#include "sprag/detail/live/time_line.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/energy.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

struct Lossy {
  double end;
  double lost_from, lost_to;
  int repeats;
};

/// V at every settled tick of an observer that receives nothing for a while.
template <Estimator E>
std::vector<double> error_energy(const Scene& scene, double h, const Lossy& lossy,
                                 EventCounts& counts, std::vector<DegradedInterval>& degraded) {
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  std::vector<State> truth;
  for (std::int64_t k = 0; k <= last_tick(lossy.end, h); ++k) {
    master.advance(tick_instant(k, h), events);
    State state{Eigen::VectorXd(scene.model.coordinates()),
                Eigen::VectorXd(scene.model.coordinates())};
    master.state(tick_instant(k, h), state.q, state.u);
    truth.push_back(state);
  }
  master.advance(at(lossy.end), events);

  E estimator(scene.model, h);
  TimeLine line(estimator, 1, scene.prior.start, 50);
  const ErrorEnergy energy(scene.model);
  std::vector<double> V;
  State state = truth.front();
  for (const ContactMessage& report :
       reports_at(event_and_heartbeat_times(events, 0.05, lossy.end), events, 1)) {
    if (report.horizon > lossy.lost_from && report.horizon < lossy.lost_to) continue;
    if (!line.started()) {
      line.restart(report);
    } else {
      line.receive(with_repeats(report, lossy.repeats));
    }
    line.run(
        line.settled_tick() + 20, [](const auto&) {},
        [&](const auto& settled) {
          const auto k = static_cast<std::size_t>(settled.tick);
          EXPECT_EQ(k, V.size());
          estimator.output(settled, state.q, state.u);
          V.push_back(energy(truth[k].q, truth[k].u, state.q, state.u)[0]);
          return true;
        });
  }
  counts = line.events().counts();
  degraded = line.events().degraded();
  EXPECT_EQ(V.size(), truth.size());
  return V;
}

template <Estimator E>
void expect_convergence(const char* name, double lost_from, double lost_to) {
  const Scene& scene = cached_scene(name);
  const double h = 1e-2;
  EventCounts counts;
  std::vector<DegradedInterval> degraded;
  const Lossy lossy{80.0, lost_from, lost_to, 2};
  const auto V = error_energy<E>(scene, h, lossy, counts, degraded);
  EXPECT_GT(counts.lost_records, 0);
  EXPECT_EQ(counts.of(Skip::contradicting), 0);
  ASSERT_EQ(degraded.size(), 1U);
  EXPECT_GE(degraded[0].from, lost_from - 0.05);
  EXPECT_GT(degraded[0].to, degraded[0].from);
  EXPECT_LE(degraded[0].to, lost_to + 0.1);
  const double after_gap = V.at(static_cast<std::size_t>(last_tick(lost_to + 0.1, h)));
  std::cout << name << ": V after the gap " << after_gap << ", at the end " << V.back() << '\n';
  EXPECT_GT(after_gap, 1e-2);
  EXPECT_LT(V.back(), 1e-3 * after_gap);
}

TEST(DegradedRun, TheBeamConvergesAfterAGap) {
  expect_convergence<JitteringBoth>("paper_beam.toml", 2.0, 8.0);
}

TEST(DegradedRun, TheChatteringBeamConvergesAfterAGap) {
  expect_convergence<ReplicaEstimator>("paper_beam_chatter.toml", 2.0, 8.0);
  expect_convergence<ExactBoth>("paper_beam_chatter.toml", 2.0, 8.0);
}

}  // namespace
}  // namespace sprag
