// An adaptive estimator's ticks: before a result, at a result, with the joint filter, and through
// sustained contacts.
#include <gtest/gtest.h>

#include "sprag/detail/filter/tracking_estimator.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

TEST(TrackingEstimator, TicksDoNotAllocate) {
  const Scene machine = shipped_scene("paper_beam");
  Scene given = machine;
  given.model.contacts[0].restitution = 0.68;
  given.model.outputs = {{"a", Eigen::Vector3d::Ones()}, {"b", Eigen::Vector3d::Ones(), true}};
  const std::vector<ContactEvent> events = events_of(machine, 110.0);
  constexpr double h = 0.01;
  TrackingEstimator estimator(given, h, EstimatorKind::adaptive);
  TrackingState state, saved;
  estimator.start(given.prior.start, 0, 0, state);
  estimator.start(given.prior.start, 0, 0, saved);
  Confidence confidence = estimator.no_confidence();
  Eigen::VectorXd q(3), u(3);
  AdaptationTask task;
  task.events.reserve(TrackingEstimator::most_events);
  AdaptationResult result;
  std::size_t next = 0;
  long allocations = 0, of_filter = 0, results = 0;
  for (std::int64_t k = 1; k <= 11000; ++k) {
    const std::size_t first = next;
    while (next < events.size() && events[next].t <= tick_instant(k, h).hi) ++next;
    if (estimator.waits(state)) {
      allocations += allocations_of([&] { estimator.wanted(state, task); });
      result = run(task, *estimator.family());
      ++results;
      estimator.put(result);
    }
    allocations += allocations_of([&] {
      estimator.tick(std::span(events).subspan(first, next - first), state);
      estimator.output(state, q, u);
      estimator.confidence(state, confidence);
      saved = state;
    });
    of_filter += confidence.from_filter ? 1 : 0;
  }
  EXPECT_EQ(allocations, 0);
  EXPECT_GE(results, 1);
  EXPECT_GT(of_filter, 8000);
}

}  // namespace
}  // namespace sprag::test
