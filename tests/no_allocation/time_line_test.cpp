// The observer's time line in use: late reports in succession, and its output through the queue to
// a message.
#include "sprag/detail/live/time_line.h"

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <vector>

#include "lcmtypes/contact_messages.h"
#include "observer/master_clock.h"
#include "observer/messages.h"
#include "observer/spsc_queue.h"
#include "recording/session_tracker.h"
#include "sprag/detail/live/histogram.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag::test {
namespace {

template <typename E>
class TimeLineRun : public testing::Test {};
using Estimators = testing::Types<BothEstimator>;
TYPED_TEST_SUITE(TimeLineRun, Estimators);

/// The received messages: a report every 10 ms and at every event, encoded.
std::vector<std::vector<std::uint8_t>> messages_of(std::span<const ContactEvent> events,
                                                   int contacts, double end) {
  std::vector<std::vector<std::uint8_t>> messages;
  const auto times = event_and_heartbeat_times(events, 1e-2, end);
  for (const ContactMessage& report : reports_at(times, events, contacts)) {
    encode(report, messages.emplace_back());
  }
  return messages;
}

/// The shipped scene and, for estimators that use it, the same with jitter.
template <Estimator E>
std::vector<Scene> scenes(const char* name) {
  std::vector<Scene> all{cached_scene(name)};
  if (std::is_same_v<E, BothEstimator>) {
    all.push_back(all.front());
    all.back().prior.jitter = 1e-3;
  }
  return all;
}

template <Estimator E>
void expect_no_allocation(const Scene& scene) {
  SCOPED_TRACE(scene.prior.jitter);
  const double end = 30.0;
  const double h = 1e-3;
  const std::vector<ContactEvent> events = master_events(scene, end);
  const std::vector<std::vector<std::uint8_t>> messages = messages_of(events, 1, end);
  E estimator(scene, h);
  TimeLine line(estimator, 1, scene.prior.start, 100);
  SessionTracker sessions;
  EstimateSample empty;
  empty.q.setZero(scene.model.coordinates());
  empty.u.setZero(scene.model.coordinates());
  empty.confidence = estimator.no_confidence();
  SpscQueue<EstimateSample> queue(256, empty);
  estimate_t estimate{};
  std::vector<std::uint8_t> buffer;
  fill(estimate, empty);
  (void)encode(estimate, buffer);
  ContactMessage report;
  Refusal refusal = decode(messages.front(), report);
  ASSERT_EQ(refusal, Refusal::none);
  ASSERT_EQ(sessions.receive(report, {}), SessionTracker::Verdict::starts);
  line.restart(report);

  const auto send = [&](const auto& state) {
    EstimateSample* slot = queue.free_slot();
    if (slot == nullptr) return false;
    slot->tick = state.tick;
    slot->closed = state.chi;
    estimator.output(state, slot->q, slot->u);
    if constexpr (requires { estimator.confidence(state, slot->confidence); }) {
      estimator.confidence(state, slot->confidence);
    } else {
      estimator.note(state, slot->confidence);
    }
    queue.push();
    return true;
  };
  MasterClock clock;
  Histogram latency;
  long bytes = 0;
  long settled = 0;
  CountAllocations counting;
  for (std::size_t i = 1; i < messages.size() && refusal == Refusal::none; ++i) {
    refusal = decode(messages[i], report);
    const Arrival arrival{static_cast<std::int64_t>(1e9 * report.horizon), report.utime};
    if (sessions.receive(report, arrival) == SessionTracker::Verdict::continues) {
      clock.observe(report, arrival);
      line.receive(report);
    }
    latency.add(arrival.monotonic - clock.local(report.horizon));
    // A delay of half the history: the present is 50 ticks ahead of the watermark.
    line.run(last_tick(report.horizon, h) + 50, send, [&](const auto& state) {
      ++settled;
      return send(state);
    });
    while (const EstimateSample* sample = queue.front()) {
      fill(estimate, *sample);
      bytes += static_cast<long>(encode(estimate, buffer).size());
      queue.pop();
    }
  }
  const long allocations = counting.stop();

  EXPECT_EQ(allocations, 0);
  EXPECT_EQ(refusal, Refusal::none);
  EXPECT_GE(settled, 29999);
  EXPECT_GT(bytes, 60000 * 50);
  EXPECT_GT(line.rollbacks().rollbacks, 20);
  EXPECT_GT(line.rollbacks().ticks_redone, 500);
  EXPECT_EQ(line.events().events(), events);
}

TYPED_TEST(TimeLineRun, NeverAllocatesBetweenMessages) {
  for (const char* name : {"paper_beam.toml", "paper_beam_chatter.toml"}) {
    SCOPED_TRACE(name);
    for (const Scene& scene : scenes<TypeParam>(name)) expect_no_allocation<TypeParam>(scene);
  }
}

// Endless events, so that the time line drops old ones, and twenty losses of more records than the
// next messages repeat.
TYPED_TEST(TimeLineRun, ForgettingAndGapsDoNotAllocate) {
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
  TypeParam estimator(scene, h);
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
