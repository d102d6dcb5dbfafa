// A whole observer without threads and sockets, with a network that loses, delays, duplicates and
// reorders messages by a seeded plan.
#include <gtest/gtest.h>

#include <iostream>
#include <limits>

#include "recording/session_tracker.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/replica/replica.h"
#include "tests/support/random.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

struct Delivery {
  double arrival;
  const ContactMessage* report;
};

struct Plan {
  double loss, delay, reordering, doubling;
};

std::vector<Delivery> deliver(const std::vector<ContactMessage>& reports, const Plan& plan,
                              Random& random) {
  std::vector<Delivery> deliveries;
  for (const ContactMessage& report : reports) {
    const bool last = &report == &reports.back();
    if (!last && random.chance(plan.loss)) continue;
    double arrival = report.horizon + plan.delay;
    if (random.chance(plan.reordering)) arrival += random.uniform(0.0, 0.3);
    deliveries.push_back({arrival, &report});
    if (random.chance(plan.doubling)) {
      deliveries.push_back({arrival + random.uniform(0.0, 0.3), &report});
    }
  }
  std::stable_sort(deliveries.begin(), deliveries.end(),
                   [](const Delivery& a, const Delivery& b) { return a.arrival < b.arrival; });
  return deliveries;
}

template <typename E>
class NetworkTest : public ::testing::Test {
 protected:
  struct Figures {
    std::int64_t rollbacks = 0, lost = 0, doubled = 0, reordered = 0;
  };

  void expect_equal_to_offline(const Scene& scene, double end, std::uint64_t seed) {
    SCOPED_TRACE(scene.name + " seed " + std::to_string(seed));
    Random random(seed);
    constexpr std::array steps{0.02, 0.01, 0.007, 1.0 / 128};
    constexpr std::array histories{1, 20, 100, 400};
    const double h = steps[seed % steps.size()];
    const auto history = histories[static_cast<std::size_t>(random.integer(0, 3))];
    const auto events = master_events(scene, end);
    const auto reports = reports_at(event_and_heartbeat_times(events, 0.01, end), events, 1);
    const Plan plan{random.uniform(0.0, 0.6), random.uniform(0.0, 1.0), 0.25, 0.2};

    E estimator(scene.model, h);
    TimeLine line(estimator, 1, scene.prior.start, history);
    SessionTracker tracker;
    Recording settled;
    std::int64_t next_seen = 0;
    for (const Delivery& delivery : deliver(reports, plan, random)) {
      switch (tracker.receive(*delivery.report, {})) {
        case SessionTracker::Verdict::starts:
          line.restart(*delivery.report);
          break;
        case SessionTracker::Verdict::continues:
          line.receive(*delivery.report);
          break;
        case SessionTracker::Verdict::resumes:
          ADD_FAILURE() << "nothing has jumped";
          break;
        case SessionTracker::Verdict::ignored:
          break;
      }
      if (random.chance(0.2)) continue;
      const double now = std::max(delivery.arrival + random.uniform(-1.0, 0.5), 0.0);
      line.run(
          last_tick(now, h),
          [&](const auto& state) {
            EXPECT_EQ(state.tick, next_seen);
            next_seen = state.tick + 1;
          },
          [&](const auto& state) {
            EXPECT_LE(state.tick, line.settled_tick());
            if (random.chance(0.05)) return false;
            settled.add(estimator, state, scene.model.coordinates());
            return true;
          });
    }
    line.run(
        0, [](const auto&) {},
        [&](const auto& state) {
          settled.add(estimator, state, scene.model.coordinates());
          return true;
        });
    ASSERT_EQ(line.events().counts().lost_records, 0) << "not a plan that repeats repair";
    EXPECT_EQ(line.events().events(), events);
    EXPECT_EQ(line.events().counts().events, static_cast<std::int64_t>(events.size()));
    EXPECT_EQ(difference(offline<E>(scene.model, scene.prior.start, h, events, end), settled), "");
    figures_.rollbacks += line.rollbacks().rollbacks;
    figures_.lost += tracker.counts().lost;
    figures_.doubled += tracker.counts().doubled;
    figures_.reordered += tracker.counts().reordered;
  }

  void run(const char* name, double end, int plans = long_repetitions(200)) {
    const Scene& scene = cached_scene(name);
    for (int i = 1; i <= plans && !this->HasFatalFailure(); ++i) {
      expect_equal_to_offline(scene, end, static_cast<std::uint64_t>(i));
    }
    std::cout << name << ": seeds 1.." << plans << ", rollbacks " << figures_.rollbacks << ", lost "
              << figures_.lost << ", doubled " << figures_.doubled << ", reordered "
              << figures_.reordered << '\n';
    EXPECT_GT(figures_.rollbacks, plans);
    EXPECT_GT(figures_.lost, plans);
    EXPECT_GT(figures_.doubled, plans);
    EXPECT_GT(figures_.reordered, plans);
  }

 private:
  Figures figures_;
};

using Estimators = ::testing::Types<ReplicaEstimator, ExactBoth, JitteringBoth>;
TYPED_TEST_SUITE(NetworkTest, Estimators);

TYPED_TEST(NetworkTest, SettledTicksOfTheBeamEqualAnOfflineRun) {
  this->run("paper_beam.toml", 6.0);
}

TYPED_TEST(NetworkTest, SettledTicksOfTheChatteringBeamEqualAnOfflineRun) {
  this->run("paper_beam_chatter.toml", 4.0);
}

}  // namespace
}  // namespace sprag
