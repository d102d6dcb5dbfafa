#include "observer/timing_filter.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <iostream>
#include <random>

#include "mechanics/energy.h"
#include "mechanics/replica.h"
#include "observer/time_line.h"
#include "tests/observer/recorded_run.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

/// The master and a filter that is told its events, tick by tick.
struct Pursuit {
  explicit Pursuit(const Scene& scene, double h, Uncertainty uncertainty)
      : scene_(scene),
        h_(h),
        master(scene.model, scene.master),
        filter(scene.model, h, std::move(uncertainty)),
        energy_(scene.model),
        truth{scene.master.q, scene.master.u},
        mean(truth) {
    filter.start(scene.replica, 0, 0, state);
  }

  /// One tick; `spoil` may change the events.
  template <typename Spoil>
  double tick(const Spoil& spoil) {
    ++k_;
    events_.clear();
    master.advance(tick_instant(k_, h_), events_);
    impacts += static_cast<int>(events_.size());
    spoil(events_);
    filter.tick(events_, state);
    master.state(tick_instant(k_, h_), truth.q, truth.u);
    filter.output(state, mean.q, mean.u);
    return energy_(truth.q, truth.u, mean.q, mean.u)[0];
  }
  double tick() {
    return tick([](auto&) {});
  }

  const Scene& scene_;
  double h_;
  Master master;
  TimingFilter filter;
  TimingFilter::State state;
  ErrorEnergy energy_;
  State truth, mean;
  std::vector<ContactEvent> events_;
  std::int64_t k_ = 0;
  int impacts = 0;
};

// 2 f unknowns, one equation an impact.
TEST(TimingFilter, KnowsThePapersBeamAfterSixImpacts) {
  const Scene& scene = shipped_scene("paper_beam.toml");
  Pursuit run(scene, 1e-2, uncertainty_of(scene));
  double before = 0.0;
  for (int k = 0; k < 4000; ++k) {
    const int known = run.impacts;
    const double V = run.tick();
    if (run.impacts != known && run.impacts <= 8) {
      std::cout << "t " << 1e-2 * (k + 1) << " impacts " << run.impacts << " V " << V << '\n';
    }
    if (run.impacts < 6) before = V;
    if (run.impacts >= 6) {
      EXPECT_LT(V, 1e-15);
    }
  }
  EXPECT_GT(before, 1e-8);
}

TEST(TimingFilter, LocksTheOtherScenesWithinThreeTimesAsManyEventsAsUnknowns) {
  for (const char* name : {"paper_beam_chatter", "paper_beam_frame", "bouncing_ball", "lab_rig",
                           "two_stops_beam", "steel_ruler", "paper_beam_as_printed"}) {
    const Scene& scene = shipped_scene(std::string(name) + ".toml");
    Pursuit run(scene, 1e-3, uncertainty_of(scene));
    const int enough = 3 * 2 * static_cast<int>(scene.model.coordinates());
    double V = 0.0;
    const double first = ErrorEnergy(scene.model)(scene.master.q, scene.master.u, scene.replica.q,
                                                  scene.replica.u)[0];
    for (int k = 0; k < 100000 && run.impacts < enough; ++k) V = run.tick();
    EXPECT_EQ(run.state.refused_impacts, 0) << name;
    std::cout << name << ": V " << first << " -> " << V << " after " << run.impacts << " events, t "
              << 1e-3 * static_cast<double>(run.k_) << '\n';
    EXPECT_LT(V, 1e-15 * (first + 1e-3)) << name;
  }
}

// In a time line: events that come late, one by one, and rollbacks for no reason.
TEST(TimingFilter, RollbacksDoNotShow) {
  for (const char* name : {"paper_beam", "paper_beam_chatter", "two_stops_beam"}) {
    const Scene& scene = shipped_scene(std::string(name) + ".toml");
    const double h = 1e-2;
    const double end = 8.0;
    const auto events = master_events(scene, end);
    const auto run = [&](bool late) {
      TimingFilter filter(scene.model, h, uncertainty_of(scene));
      TimeLine<TimingFilter> line(filter, static_cast<int>(scene.model.contacts.size()),
                                  scene.replica, 30);
      line.restart(0, 0, 0, no_horizon);
      Random random(3);
      Recording settled;
      const auto settle = [&](std::int64_t target) {
        line.run(
            target, [](const auto&) {},
            [&](const auto& state) {
              settled.add(filter, state, scene.model.coordinates());
              return true;
            });
      };
      std::size_t next = 0;
      for (std::int64_t k = 1; k <= last_tick(end, h); ++k) {
        const double t = tick_instant(k, h).hi;
        if (late) settle(k + 20);
        for (; next < events.size() && events[next].t <= t; ++next) line.receive(events[next]);
        line.set_horizon(t);
        if (late) settle(k + 20);
        if (late) line.go_back_to(line.now() - random.integer(1, 40));
      }
      settle(0);
      return settled;
    };
    const Recording once = run(false);
    EXPECT_EQ(once.ticks.size(), 801U);
    EXPECT_EQ(difference(once, run(true)), "") << name;
  }
}

// What is told as deviation is what the error is, with event times that jitter. Later than this the
// machine's chaos has drawn the covariance out so far that what is not linear shows along its short
// axes.
TEST(TimingFilter, IsCalibratedWhileTheCovarianceIsRound) {
  const Scene& scene = shipped_scene("paper_beam.toml");
  const Eigen::Index f = scene.model.coordinates();
  const int runs = repetitions(2000);
  for (const double sigma : {1e-5, 1e-4}) {
    std::mt19937_64 engine(7);
    std::normal_distribution<double> normal;
    constexpr double of_q = 2e-3;
    constexpr double of_u = 5e-3;
    double sum = 0.0;
    for (int i = 0; i < runs; ++i) {
      Scene start = scene;
      for (Eigen::Index k = 0; k < f; ++k) {
        start.replica.q[k] = start.master.q[k] + of_q * normal(engine);
        start.replica.u[k] = start.master.u[k] + of_u * normal(engine);
      }
      Pursuit run(
          start, 0.1,
          {of_q * Eigen::MatrixXd::Identity(f, f), of_u * Eigen::MatrixXd::Identity(f, f), sigma});
      for (int k = 0; k < 40; ++k) {
        run.tick([&](std::vector<ContactEvent>& events) {
          for (ContactEvent& event : events) event.t += sigma * normal(engine);
        });
      }
      Eigen::VectorXd error(2 * f);
      error << run.truth.q - run.mean.q, run.truth.u - run.mean.u;
      sum += error.dot(run.filter.covariance(run.state).ldlt().solve(error));
    }
    const double ratio = sum / runs / static_cast<double>(2 * f);
    std::cout << "seed 7, sigma " << sigma << ": chi^2 / 2f = " << ratio << '\n';
    EXPECT_NEAR(ratio, 1.0, sanitized ? 0.3 : 0.05);
  }
}

}  // namespace
}  // namespace sprag
