// Processing of a message before and after the time line.
#include "observer/messages.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "lcmtypes/contact_messages.h"
#include "recording/session_tracker.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/random.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"

namespace sprag::test {
namespace {

std::vector<ContactMessage> random_reports(std::uint64_t seed, int count) {
  Random random(seed);
  const auto events = random_events(random, 5, count, 0.0, 0.01);
  return reports_at(event_and_heartbeat_times(events, 1e-2, events.back().t), events, 5);
}

// More masters than the tracker remembers, and duplicated, reordered and old messages.
TEST(SessionTracker, ReceivesWithoutAllocating) {
  SessionTracker tracker;
  ContactMessage report;
  CountAllocations counting;
  for (std::int64_t session = 1; session <= 300; ++session) {
    for (std::int64_t i = 0; i < 200; ++i) {
      report.session = i % 50 == 49 ? session - 1 : session;
      report.sequence = i ^ 3;
      (void)tracker.receive(report, {1'000'000'000 * session, 0});
      if (i % 7 == 0) (void)tracker.receive(report, {1'000'000'000 * session, 0});
    }
  }
  const long allocations = counting.stop();
  EXPECT_EQ(allocations, 0);
  EXPECT_GT(tracker.counts().sessions, 299);
  EXPECT_GT(tracker.counts().of_past_sessions, 300);
  EXPECT_GT(tracker.counts().doubled, 300);
  EXPECT_GT(tracker.counts().reordered, 300);
}

TEST(ContactMessages, AreEncodedAndDecodedWithoutAllocating) {
  const std::vector<ContactMessage> reports = random_reports(502, 5000);
  std::vector<std::uint8_t> message;
  encode(reports.front(), message);
  ContactMessage back;
  InputMessage input;
  long good = 0;
  long refused = 0;
  CountAllocations counting;
  for (const ContactMessage& report : reports) {
    encode(report, message);
    if (decode(message, back) == Refusal::none) ++good;
    if (decode(message, input) == Refusal::wrong_type) ++refused;
    message[60] ^= 0xffU;
    message[70] ^= 0xffU;
    if (decode(message, back) != Refusal::none) ++refused;
    if (decode(std::span(message).first(100), back) == Refusal::truncated) ++refused;
  }
  const long allocations = counting.stop();
  EXPECT_EQ(allocations, 0);
  EXPECT_EQ(good, static_cast<long>(reports.size()));
  EXPECT_GE(refused, 2 * good);
}

// The type hash of generated code is computed at its first use.
TEST(Messages, AllocateOnlyTheFirstTime) {
  for (const Eigen::Index f : {1, 3, 200}) {
    EstimateSample sample;
    sample.q = Eigen::VectorXd::Ones(f);
    sample.u = Eigen::VectorXd::Ones(f);
    sample.confidence.sigma_q = sample.confidence.sigma_u = Eigen::VectorXd::Ones(f);
    sample.confidence.sigma_g = Eigen::VectorXd::Ones(5);
    sample.confidence.bound_q = Eigen::VectorXd::Ones(f);
    const std::vector<Output> outputs{{"tip", Eigen::VectorXd::Ones(f)}};
    estimate_t estimate{}, estimate_back{};
    outputs_t of_outputs{};
    bounds_t bounds{};
    state_t state{}, state_back{};
    state.f = static_cast<std::int32_t>(f);
    state.q.assign(static_cast<std::size_t>(f), 1.0);
    state.u = state.q;
    std::vector<std::uint8_t> buffer;
    long bytes = 0;
    const auto once = [&] {
      const auto truth = encode(state, buffer);
      bytes += static_cast<long>(truth.size());
      if (decode(truth, state_back) != Refusal::none) bytes = -1;
      fill(estimate, sample);
      const auto encoded = encode(estimate, buffer);
      bytes += static_cast<long>(encoded.size());
      if (decode(encoded, estimate_back) != Refusal::none) bytes = -1;
      fill(of_outputs, sample, true, outputs);
      bytes += static_cast<long>(encode(of_outputs, buffer).size());
      fill(bounds, sample, outputs);
      bytes += static_cast<long>(encode(bounds, buffer).size());
    };
    once();
    const long before = bytes;
    EXPECT_EQ(allocations_of([&] {
                for (int i = 0; i < 10000; ++i) {
                  sample.tick = i;
                  once();
                }
              }),
              0);
    EXPECT_EQ(bytes, 10001 * before);
    EXPECT_EQ(estimate_back.tick, 9999);
  }
}

}  // namespace
}  // namespace sprag::test
