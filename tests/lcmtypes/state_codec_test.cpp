#include "lcmtypes/state_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <sprag/estimate_t.hpp>
#include <sprag/state_t.hpp>

namespace sprag {
namespace {

constexpr std::size_t f_offset = 40;

EstimateSample random_sample(std::mt19937_64& random, Eigen::Index f) {
  const auto number = [&random] { return std::normal_distribution<double>()(random); };
  EstimateSample sample;
  sample.session = static_cast<std::int64_t>(random());
  sample.utime = static_cast<std::int64_t>(random());
  sample.tick = static_cast<std::int64_t>(random() >> 1U);
  sample.t = std::abs(number());
  sample.q = Eigen::VectorXd::NullaryExpr(f, number);
  sample.u = Eigen::VectorXd::NullaryExpr(f, number);
  sample.closed = random() >> 4U;
  sample.settled_tick = static_cast<std::int64_t>(random() % 1000) - 1;
  return sample;
}

void expect_equal(const StateSample& a, const StateSample& b) {
  EXPECT_EQ(a.session, b.session);
  EXPECT_EQ(a.utime, b.utime);
  EXPECT_EQ(a.tick, b.tick);
  EXPECT_EQ(a.t, b.t);
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.u, b.u);
  EXPECT_EQ(a.closed, b.closed);
}

template <class Message>
std::vector<std::uint8_t> lcm_bytes(const StateSample& sample, Message message) {
  message.session = sample.session;
  message.utime = sample.utime;
  message.tick = sample.tick;
  message.t = sample.t;
  message.f = static_cast<std::int32_t>(sample.q.size());
  message.q.assign(sample.q.begin(), sample.q.end());
  message.u.assign(sample.u.begin(), sample.u.end());
  message.closed = static_cast<std::int64_t>(sample.closed);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_GT(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())), 0);
  return bytes;
}

std::vector<std::uint8_t> copy(std::span<const std::uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}

TEST(StateCodecTest, TypeHashesAreTheOnesThatOtherProgramsKnow) {
  EXPECT_EQ(static_cast<std::uint64_t>(state_t::getHash()), 0x44a6bbc1c0625fe8U);
  EXPECT_EQ(static_cast<std::uint64_t>(estimate_t::getHash()), 0x1df20a363a99d796U);
}

TEST(StateCodecTest, RandomSamplesComeBackAndMatchLcmsOwnBytes) {
  const unsigned seed = 2;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::vector<std::uint8_t> buffer;
  StateSample state;
  EstimateSample estimate;
  for (int i = 0; i < 500; ++i) {
    const EstimateSample sample = random_sample(random, 1 + static_cast<int>(random() % 200));

    const StateSample& as_state = sample;
    EXPECT_EQ(copy(encode(as_state, buffer)), lcm_bytes(sample, state_t{}));
    ASSERT_EQ(decode(buffer, state), Refusal::none);
    expect_equal(sample, state);

    estimate_t message{};
    message.settled_tick = sample.settled_tick;
    EXPECT_EQ(copy(encode(sample, buffer)), lcm_bytes(sample, message));
    ASSERT_EQ(decode(buffer, estimate), Refusal::none);
    expect_equal(sample, estimate);
    EXPECT_EQ(estimate.settled_tick, sample.settled_tick);
  }
}

TEST(StateCodecTest, BufferAndSampleAreReused) {
  std::mt19937_64 random(5);
  std::vector<std::uint8_t> buffer;
  StateSample back;
  const StateSample first = random_sample(random, 20);
  const std::uint8_t* data = encode(first, buffer).data();
  ASSERT_EQ(decode(buffer, back), Refusal::none);
  const double* q = back.q.data();
  const StateSample second = random_sample(random, 20);
  EXPECT_EQ(encode(second, buffer).data(), data);
  ASSERT_EQ(decode(buffer, back), Refusal::none);
  EXPECT_EQ(back.q.data(), q);
}

TEST(StateCodecTest, LyingLengthsAreRefusedBeforeAnythingIsStored) {
  std::mt19937_64 random(6);
  std::vector<std::uint8_t> buffer;
  encode(static_cast<const StateSample&>(random_sample(random, 3)), buffer);
  const auto with_f = [&buffer](std::int32_t f) {
    std::vector<std::uint8_t> message = buffer;
    for (std::size_t i = 0; i < 4; ++i)
      message[f_offset + i] =
          static_cast<std::uint8_t>(static_cast<std::uint32_t>(f) >> (8 * (3 - i)));
    return message;
  };
  StateSample back;
  EXPECT_EQ(decode(with_f(3), back), Refusal::none);
  EXPECT_EQ(decode(with_f(0), back), Refusal::bad_count);
  EXPECT_EQ(decode(with_f(-1), back), Refusal::bad_count);
  EXPECT_EQ(decode(with_f(std::numeric_limits<std::int32_t>::min()), back), Refusal::bad_count);
  EXPECT_EQ(decode(with_f(4), back), Refusal::truncated);
  EXPECT_EQ(decode(with_f(std::numeric_limits<std::int32_t>::max()), back), Refusal::truncated);
  EXPECT_EQ(decode(with_f(2), back), Refusal::oversized);
}

TEST(StateCodecTest, EveryCutIsTruncatedAndEveryOtherTypeIsRefused) {
  std::mt19937_64 random(7);
  std::vector<std::uint8_t> state, estimate;
  const EstimateSample sample = random_sample(random, 2);
  encode(static_cast<const StateSample&>(sample), state);
  encode(sample, estimate);
  StateSample back;
  EstimateSample back_estimate;
  for (std::size_t size = 0; size < state.size(); ++size)
    ASSERT_EQ(decode(copy(std::span(state).first(size)), back), Refusal::truncated) << size;
  for (std::size_t size = 0; size < estimate.size(); ++size)
    ASSERT_EQ(decode(copy(std::span(estimate).first(size)), back_estimate), Refusal::truncated);
  EXPECT_EQ(decode(estimate, back), Refusal::wrong_type);
  EXPECT_EQ(decode(state, back_estimate), Refusal::wrong_type);
}

TEST(StateCodecTest, ImpossibleValuesAreRefusedWithTheirCause) {
  std::mt19937_64 random(8);
  const EstimateSample good = random_sample(random, 2);
  const auto refusal = [](const EstimateSample& sample) {
    std::vector<std::uint8_t> buffer;
    encode(sample, buffer);
    EstimateSample back;
    return decode(buffer, back);
  };
  EXPECT_EQ(refusal(good), Refusal::none);
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EstimateSample sample = good;
    sample.t = bad;
    EXPECT_EQ(refusal(sample), Refusal::bad_time);
    sample = good;
    sample.q[1] = bad;
    EXPECT_EQ(refusal(sample), Refusal::bad_value);
    sample = good;
    sample.u[0] = bad;
    EXPECT_EQ(refusal(sample), Refusal::bad_value);
  }
  EstimateSample sample = good;
  sample.t = -1.0;
  EXPECT_EQ(refusal(sample), Refusal::bad_time);
  sample = good;
  sample.tick = -1;
  EXPECT_EQ(refusal(sample), Refusal::bad_time);
  sample = good;
  sample.settled_tick = -2;
  EXPECT_EQ(refusal(sample), Refusal::bad_time);
  sample = good;
  sample.closed = bit(max_contacts);
  EXPECT_EQ(refusal(sample), Refusal::bad_closed);
}

}  // namespace
}  // namespace sprag
