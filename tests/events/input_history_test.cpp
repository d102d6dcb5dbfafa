// Samples of a streamed input from messages that are lost, doubled and out of order, and the
// streamed input itself against a record of the same samples.
#include "sprag/detail/events/input_history.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "tests/support/random.h"

namespace sprag {
namespace {

constexpr double dt = 0.01;

double sample(std::int64_t k) { return std::sin(0.3 * static_cast<double>(k)); }

SampledInput record_of(std::int64_t samples) {
  std::vector<double> t, values;
  for (std::int64_t k = 0; k < samples; ++k) {
    t.push_back(dt * static_cast<double>(k));
    values.push_back(sample(k));
  }
  return {t, values, {.outside = Outside::hold, .gain = 2.0, .delay = -0.004}};
}

InputMessage message_of(std::int64_t total, int n) {
  InputMessage message{.t0 = 0.0, .dt = dt, .total = total, .n = n};
  for (int i = 0; i < n; ++i) {
    message.value[static_cast<std::size_t>(i)] = sample(message.first() + i);
  }
  return message;
}

TEST(InputHistory, BadNetworkGivesTheRecord) {
  constexpr std::uint64_t seed = 31;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  const SampledInput record = record_of(2000);
  SampledInput input = SampledInput::streamed(record, 3000);
  InputHistory history(input);
  std::vector<InputMessage> messages;
  for (std::int64_t total = 5; total <= 2000; total += 5) {
    messages.push_back(message_of(total, static_cast<int>(std::min<std::int64_t>(total, 150))));
  }
  const InputMessage last = messages.back();
  for (std::size_t i = 0; i + 3 < messages.size(); ++i) {
    if (random.chance(0.2)) std::swap(messages[i], messages[i + 3]);
  }
  for (const InputMessage& message : messages) {
    if (random.chance(0.3)) continue;
    history.take(message);
    if (random.chance(0.2)) history.take(message);
  }
  history.take(last);
  EXPECT_EQ(history.counts().samples, 2000);
  EXPECT_EQ(history.counts().gaps, 0);
  ASSERT_EQ(input.knots().size(), record.knots().size());
  for (std::size_t k = 0; k < input.knots().size(); ++k) {
    EXPECT_NEAR(input.knots()[k], record.knots()[k], 1e-12);
  }
  for (double t = 0.1; t < 19.9; t += 0.037) {
    EXPECT_NEAR(input.value(t), record.value(t), 1e-12);
    EXPECT_NEAR(input.velocity(t), record.velocity(t), 1e-12);
    EXPECT_NEAR(input.displacement(t), record.displacement(t), 1e-11);
  }
  EXPECT_NEAR(input.appended_rms(), record.rms(), 1e-12);
}

TEST(InputHistory, GapsAreInterpolatedAndReported) {
  SampledInput input = SampledInput::streamed(record_of(10), 1000);
  InputHistory history(input);
  EXPECT_TRUE(history.take(message_of(10, 10)).any);
  const InputHistory::Taken taken = history.take(message_of(30, 5));
  EXPECT_TRUE(taken.any);
  EXPECT_EQ(history.counts().gaps, 1);
  EXPECT_EQ(history.counts().filled, 15);
  EXPECT_NEAR(taken.gap_from, 0.086, 1e-12);
  EXPECT_NEAR(taken.gap_to, 0.246, 1e-12);
  EXPECT_NEAR(input.value(0.17 - 0.004), 2.0 * (0.5 * sample(9) + 0.5 * sample(25)), 1e-12);
}

TEST(InputHistory, RefusesAnotherIntervalAndEndsWhenFull) {
  SampledInput input = SampledInput::streamed(record_of(10), 20);
  InputHistory history(input);
  InputMessage other = message_of(5, 5);
  other.dt = 0.02;
  EXPECT_FALSE(history.take(other).any);
  EXPECT_EQ(history.counts().refused, 1);
  EXPECT_FALSE(history.started());
  EXPECT_TRUE(history.take(message_of(15, 15)).any);
  other = message_of(16, 5);
  other.dt *= 1.0 + 1e-9;
  EXPECT_FALSE(history.take(other).any);
  EXPECT_EQ(history.counts().refused, 2);
  EXPECT_TRUE(history.take(message_of(40, 40)).any);
  EXPECT_EQ(input.appended(), 20U);
  EXPECT_GT(history.counts().no_room, 0);
  history.restart();
  EXPECT_FALSE(history.started());
  EXPECT_EQ(input.value(0.05), 0.0);
}

// The clock of the sensor is 200 ppm slow against that of the record.
TEST(InputHistory, TakesTheIntervalOfTheSession) {
  constexpr double rate = 1.0002;
  SampledInput input = SampledInput::streamed(record_of(10), 5000);
  InputHistory history(input);
  for (std::int64_t total = 50; total <= 4000; total += 50) {
    InputMessage message = message_of(total, 50);
    message.dt = rate * dt;
    EXPECT_TRUE(history.take(message).any);
  }
  EXPECT_EQ(input.spacing(), rate * dt);
  EXPECT_NEAR(input.last(), 3999 * rate * dt - 0.004, 1e-12);
  EXPECT_NEAR(input.value(3900.5 * rate * dt - 0.004), sample(3900) + sample(3901), 1e-9);
  history.restart();
  EXPECT_EQ(input.spacing(), dt);
}

}  // namespace
}  // namespace sprag
