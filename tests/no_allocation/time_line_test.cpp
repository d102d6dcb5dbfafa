// The observer's time line in use: late reports in succession.
#include "sprag/detail/live/time_line.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/no_allocation/allocations.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag::test {
namespace {

// Endless events, so that the time line drops old ones, and twenty losses of more records than the
// next messages repeat.
TEST(TimeLine, ForgettingGapsAndRollbacksDoNotAllocate) {
  Random random(401);
  Scene scene = cached_scene("paper_beam.toml");
  Contact second;
  second.w = Eigen::Vector3d(1.0, 0.5, -0.3);
  second.restitution = 0.7;
  scene.model.contacts.push_back(second);
  const double h = 1e-2;
  const auto events = random_events(random, 2, 40000, 0.001, 0.008);
  const double end = events.back().t;
  std::vector<double> times;
  for (double t = 0.0; t < end; t += 0.05) times.push_back(t);
  const std::vector<ContactMessage> reports = reports_at(times, events, 2);
  BothEstimator estimator(scene, h);
  TimeLine line(estimator, 2, cached_scene("paper_beam.toml").prior.start, 100);
  line.restart(reports.front());

  std::int64_t settled = 0;
  std::size_t most = 0;
  CountAllocations counting;
  for (std::size_t i = 1; i < reports.size(); ++i) {
    if (i % 1000 > 950) continue;
    line.receive(reports[i]);
    most = std::max(most, line.events().events().size());
    line.run(
        last_tick(reports[i].horizon, h) + 5, [](const auto&) {},
        [&](const auto&) { return ++settled > 0; });
  }
  const long allocations = counting.stop();

  EXPECT_EQ(allocations, 0);
  EXPECT_GT(settled, 20000);
  EXPECT_GT(line.rollbacks().rollbacks, 2000);
  EXPECT_GT(line.events().counts().lost_records, 100);
  EXPECT_GT(line.events().counts().made_up, 0);
  EXPECT_GT(most, 30000U);
  EXPECT_LT(line.events().events().size(), 10000U);  // it has dropped old events
}

}  // namespace
}  // namespace sprag::test
