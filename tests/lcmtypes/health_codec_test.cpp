#include "lcmtypes/health_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <random>
#include <sprag/health_t.hpp>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

health_t random_health(std::mt19937_64& random) {
  const auto count = [&random] { return static_cast<std::int64_t>(random() >> 1U); };
  const auto size = [&random] { return std::generate_canonical<double, 53>(random); };
  health_t health{};
  health.session = static_cast<std::int64_t>(random());
  health.utime = count();
  health.tick = count() - 1;
  health.t = random() % 4 == 0 ? -1.0 : size();
  health.last = static_cast<std::int8_t>(random() % 2);
  health.master = static_cast<std::int8_t>(random() % 4);
  health.input = static_cast<std::int8_t>(random() % 3);
  health.estimate = static_cast<std::int8_t>(random() % 4);
  health.speed = random() % 4 == 0 ? infinity : size();
  for (double* x :
       {&health.period, &health.real_time_factor, &health.latency_p50, &health.latency_p99,
        &health.latency_max, &health.lateness_p50, &health.lateness_p99, &health.lateness_max}) {
    *x = size();
  }
  for (std::int64_t* n : {&health.latencies,
                          &health.sessions,
                          &health.ticks,
                          &health.deadlines,
                          &health.missed_deadlines,
                          &health.real_time_losses,
                          &health.events,
                          &health.late_events,
                          &health.lost_events,
                          &health.gaps,
                          &health.skipped_events,
                          &health.rollbacks,
                          &health.inconsistencies,
                          &health.messages,
                          &health.lost_messages,
                          &health.doubled_messages,
                          &health.reordered_messages,
                          &health.other_masters,
                          &health.stale,
                          &health.overflowed,
                          &health.unsent}) {
    *n = count();
  }
  health.causes = static_cast<std::int32_t>(random() % 20);
  for (std::int32_t i = 0; i < health.causes; ++i) {
    health.cause.push_back("cause " + std::string(random() % 50, static_cast<char>('a' + i)));
    health.refused.push_back(count());
  }
  return health;
}

std::vector<std::uint8_t> lcm_bytes(const health_t& message) {
  std::vector<std::uint8_t> result(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_GT(message.encode(result.data(), 0, static_cast<int>(result.size())), 0);
  return result;
}

void expect_equal(const Health& a, const health_t& b) {
  EXPECT_EQ(a.session, b.session);
  EXPECT_EQ(a.utime, b.utime);
  EXPECT_EQ(a.tick, b.tick);
  EXPECT_EQ(a.t, b.t);
  EXPECT_EQ(a.last, b.last == 1);
  EXPECT_EQ(static_cast<int>(a.master), b.master);
  EXPECT_EQ(static_cast<int>(a.input), b.input);
  EXPECT_EQ(static_cast<int>(a.estimate), b.estimate);
  EXPECT_EQ(a.period, b.period);
  EXPECT_EQ(a.real_time_factor, b.real_time_factor);
  EXPECT_EQ(a.speed, b.speed);
  EXPECT_EQ(a.latencies, b.latencies);
  EXPECT_EQ(a.latency.p50, b.latency_p50);
  EXPECT_EQ(a.latency.p99, b.latency_p99);
  EXPECT_EQ(a.latency.max, b.latency_max);
  EXPECT_EQ(a.lateness.p50, b.lateness_p50);
  EXPECT_EQ(a.lateness.p99, b.lateness_p99);
  EXPECT_EQ(a.lateness.max, b.lateness_max);
  EXPECT_EQ(a.sessions, b.sessions);
  EXPECT_EQ(a.ticks, b.ticks);
  EXPECT_EQ(a.deadlines, b.deadlines);
  EXPECT_EQ(a.missed_deadlines, b.missed_deadlines);
  EXPECT_EQ(a.real_time_losses, b.real_time_losses);
  EXPECT_EQ(a.events, b.events);
  EXPECT_EQ(a.late_events, b.late_events);
  EXPECT_EQ(a.lost_events, b.lost_events);
  EXPECT_EQ(a.gaps, b.gaps);
  EXPECT_EQ(a.skipped_events, b.skipped_events);
  EXPECT_EQ(a.rollbacks, b.rollbacks);
  EXPECT_EQ(a.inconsistencies, b.inconsistencies);
  EXPECT_EQ(a.messages, b.messages);
  EXPECT_EQ(a.lost_messages, b.lost_messages);
  EXPECT_EQ(a.doubled_messages, b.doubled_messages);
  EXPECT_EQ(a.reordered_messages, b.reordered_messages);
  EXPECT_EQ(a.other_masters, b.other_masters);
  EXPECT_EQ(a.stale, b.stale);
  EXPECT_EQ(a.overflowed, b.overflowed);
  EXPECT_EQ(a.unsent, b.unsent);
  std::vector<RefusedCount> refused;
  for (std::size_t i = 0; i < b.cause.size(); ++i) refused.push_back({b.cause[i], b.refused[i]});
  EXPECT_EQ(a.refused, refused);
}

TEST(HealthCodec, RandomHealthRoundTripsAndMatchesLcmEncoding) {
  const unsigned seed = 1;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  Health health;
  std::vector<std::uint8_t> buffer;
  for (int i = 0; i < 500; ++i) {
    const health_t message = random_health(random);
    const std::vector<std::uint8_t> bytes = lcm_bytes(message);
    ASSERT_EQ(name(decode(bytes, health)), "none");
    expect_equal(health, message);
    const auto again = encode(health, buffer);
    EXPECT_TRUE(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()));
  }
}

TEST(HealthCodec, EveryKindOfBadFieldIsRefusedWithItsCause) {
  constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
  std::mt19937_64 random(2);
  health_t good = random_health(random);
  good.causes = 2;
  good.cause = {"foreign", "bad_time"};
  good.refused = {1, 2};
  Health health;
  ASSERT_EQ(decode(lcm_bytes(good), health), Refusal::none);
  const std::vector<std::pair<Refusal, std::function<void(health_t&)>>> cases = {
      {Refusal::bad_time, [](auto& m) { m.tick = -2; }},
      {Refusal::bad_time, [](auto& m) { m.t = -0.5; }},
      {Refusal::bad_time, [](auto& m) { m.t = infinity; }},
      {Refusal::bad_time, [](auto& m) { m.period = not_a_number; }},
      {Refusal::bad_time, [](auto& m) { m.latency_p50 = -1.0; }},
      {Refusal::bad_time, [](auto& m) { m.latency_p99 = not_a_number; }},
      {Refusal::bad_time, [](auto& m) { m.lateness_max = infinity; }},
      {Refusal::bad_speed, [](auto& m) { m.real_time_factor = infinity; }},
      {Refusal::bad_speed, [](auto& m) { m.speed = not_a_number; }},
      {Refusal::bad_speed, [](auto& m) { m.speed = -1.0; }},
      {Refusal::bad_value, [](auto& m) { m.last = 2; }},
      {Refusal::bad_value, [](auto& m) { m.master = 4; }},
      {Refusal::bad_value, [](auto& m) { m.input = 3; }},
      {Refusal::bad_value, [](auto& m) { m.estimate = -1; }},
      {Refusal::bad_count, [](auto& m) { m.latencies = -1; }},
      {Refusal::bad_count, [](auto& m) { m.sessions = -1; }},
      {Refusal::bad_count, [](auto& m) { m.unsent = -1; }},
      {Refusal::bad_count, [](auto& m) { m.refused[1] = -1; }},
      {Refusal::bad_count, [](auto& m) { m.cause[0] = ""; }},
      {Refusal::bad_count, [](auto& m) { m.cause[1] = std::string(64, 'x'); }},
      {Refusal::bad_value, [](auto& m) { m.cause[0] = "a\nb"; }},
      {Refusal::bad_value, [](auto& m) { m.cause[0] = "\xc3\xa4"; }},
      {Refusal::bad_count,
       [](auto& m) {
         m.causes = 65;
         m.cause.assign(65, "foreign");
         m.refused.assign(65, 1);
       }},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    health_t bad = good;
    cases[i].second(bad);
    EXPECT_EQ(name(decode(lcm_bytes(bad), health)), name(cases[i].first)) << "case " << i;
  }
}

TEST(HealthCodec, WrongTypeAndWrongLengthAreRefused) {
  std::mt19937_64 random(3);
  health_t message = random_health(random);
  message.causes = 1;
  message.cause = {"foreign"};
  message.refused = {3};
  std::vector<std::uint8_t> bytes = lcm_bytes(message);
  Health health;
  ASSERT_EQ(decode(bytes, health), Refusal::none);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    // In a separate allocation, so that a sanitizer detects reading past its end.
    const std::vector<std::uint8_t> cut(bytes.begin(),
                                        bytes.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_EQ(decode(cut, health), Refusal::truncated) << size;
  }
  bytes.push_back(0);
  EXPECT_EQ(decode(bytes, health), Refusal::oversized);
  bytes[0] ^= 1U;
  EXPECT_EQ(decode(bytes, health), Refusal::wrong_type);
}

TEST(HealthCodec, RandomBytesNeverYieldImpossibleHealth) {
  const unsigned seed = 4;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  int accepted = 0;
  Health health;
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::uint8_t> bytes = lcm_bytes(random_health(random));
    for (auto flips = random() % 4; flips-- > 0;) {
      bytes[8 + random() % (bytes.size() - 8)] = static_cast<std::uint8_t>(random());
    }
    if (decode(bytes, health) != Refusal::none) continue;
    ++accepted;
    ASSERT_TRUE(health.tick >= -1 && std::isfinite(health.t) && health.period >= 0.0);
    ASSERT_LE(health.refused.size(), 64U);
    for (const RefusedCount& refused : health.refused) {
      ASSERT_TRUE(!refused.cause.empty() && refused.cause.size() < 64 && refused.count >= 0);
    }
  }
  EXPECT_GT(accepted, 1000);
  EXPECT_LT(accepted, 20000);
}

}  // namespace
}  // namespace sprag
