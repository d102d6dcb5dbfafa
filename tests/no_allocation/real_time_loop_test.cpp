// The real-time loop, from messages in its inbox to estimates and status in the outbox.
#include "observer/real_time_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>

#include "observer/estimation.h"
#include "observer/mailboxes.h"
#include "observer/notices.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"

namespace sprag::test {
namespace {

// The samples of the scene's record on SPRAG_INPUT, up to some after `end`.
void push_inputs(const Scene& scene, double end, Inbox& inbox) {
  const SampledInput& record = *scene.model.forces[0].input;
  InputMessage message;
  message.session = 7;
  message.t0 = record.sample_times().front();
  message.dt = record.spacing();
  const std::vector<double>& samples = record.sample_values();
  while (message.total < std::ssize(samples) &&
         message.t0 + static_cast<double>(message.total) * message.dt < end + 0.1) {
    message.total = std::min<std::int64_t>(message.total + 50, std::ssize(samples));
    message.n = static_cast<int>(std::min<std::int64_t>(message.total, max_input_values));
    std::copy(samples.begin() + message.first(), samples.begin() + message.total,
              message.value.begin());
    ReceivedInput* slot = inbox.inputs.free_slot();
    ASSERT_NE(slot, nullptr);
    *slot = {message, 0};
    inbox.inputs.push();
    ++message.sequence;
  }
}

void expect_no_allocation(const Scene& scene) {
  ObserverOptions options;
  options.duration = 4.0;
  Estimation estimation(scene, options, 1000);
  Inbox inbox;
  Outbox outbox(estimation.empty_sample());
  Notices notices;
  const std::vector<ContactEvent> events = master_events(scene, options.duration);
  const auto times = event_and_heartbeat_times(events, 1e-2, options.duration);
  std::int64_t sequence = 0;
  for (ContactMessage message :
       reports_at(times, events, static_cast<int>(scene.model.contacts.size()))) {
    message.speed = std::numeric_limits<double>::infinity();
    message.session = 7;
    message.sequence = sequence++;
    ReceivedMessage* slot = inbox.strangers.free_slot();
    ASSERT_NE(slot, nullptr);
    *slot = {message, {}};
    inbox.strangers.push();
  }
  if (scene.stream_duration > 0.0) push_inputs(scene, options.duration, inbox);
  RealTimeLoop loop(estimation, options.last(), Freshness::any, inbox, outbox, notices);
  const std::atomic<bool> stop{false};
  EXPECT_EQ(allocations_of([&] { loop.run(stop); }), 0);
  EXPECT_TRUE(loop.done());
  std::int64_t settled = 0;
  while (const Sample* sample = outbox.samples.front()) {
    settled += sample->settled ? 1 : 0;
    outbox.samples.pop();
  }
  EXPECT_EQ(settled, 4001);
  const IntegrationStatus* status = outbox.statuses.front();
  ASSERT_NE(status, nullptr);
  while (!status->last) {
    outbox.statuses.pop();
    status = outbox.statuses.front();
    ASSERT_NE(status, nullptr);
  }
  EXPECT_EQ(status->health.session, 7);
  EXPECT_EQ(status->health.tick, 4000);
  EXPECT_EQ(status->health.events, static_cast<std::int64_t>(events.size()));
}

TEST(RealTimeLoop, RunsAndReportsStatusWithoutAllocating) {
  expect_no_allocation(cached_scene("paper_beam.toml"));
}

// With the parameters' derivatives in the second run.
TEST(RealTimeLoop, TakesAStreamedExcitationWithoutAllocating) {
  Scene scene = cached_scene("swept_beam.toml");
  scene.stream_duration = 10.0;
  expect_no_allocation(scene);
  scene.prior.parameters = {{"impact.restitution", "excitation.gain"},
                            Eigen::Vector2d(1e-3, 1e-3),
                            Eigen::MatrixXd::Identity(2, 2),
                            {false, false}};
  scene.prior.jitter = 1e-6;
  expect_no_allocation(scene);
}

TEST(RealTimeLoop, BoundsTheErrorUnderTolerancesWithoutAllocating) {
  for (const char* name : {"paper_beam.toml", "paper_beam_chatter.toml", "two_supports_beam.toml",
                           "non_proportional.toml"}) {
    SCOPED_TRACE(name);
    Scene scene = cached_scene(name);
    scene.prior.uncertainty = Eigen::VectorXd::Constant(scene.model.coordinates(), 1.0);
    scene.prior.tolerance = {.time = 1e-3,
                             .restitution = 1e-3,
                             .stiffness = 1e-4,
                             .damping = 1e-3,
                             .force = 1e-3,
                             .clearance = 1e-4};
    expect_no_allocation(scene);
  }
}

}  // namespace
}  // namespace sprag::test
