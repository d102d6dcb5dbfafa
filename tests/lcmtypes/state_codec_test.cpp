#include "lcmtypes/state_codec.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <random>
#include <sprag/estimate_t.hpp>
#include <sprag/state_t.hpp>

#include "sprag/detail/mechanics/scalars.h"

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
  Confidence& confidence = sample.confidence;
  confidence.has_replica = random() % 2 == 0;
  confidence.has_filter = !confidence.has_replica || random() % 2 == 0;
  if (confidence.has_replica && random() % 2 == 0) confidence.bound = std::abs(number());
  const double t = random() % 4 == 0 ? -1.0 : std::abs(number());
  const int contact = t < 0.0 ? 0 : static_cast<int>(random() % max_contacts);
  confidence.replica = {t, contact, number(), 0.0};
  confidence.filter = {t, contact, number(), std::abs(number())};
  if (!confidence.has_filter) return sample;
  const auto size = [&number] { return std::abs(number()); };
  confidence.from_filter = random() % 2 == 0;
  confidence.sigma_q = Eigen::VectorXd::NullaryExpr(f, size);
  confidence.sigma_u = Eigen::VectorXd::NullaryExpr(f, size);
  confidence.sigma_g =
      Eigen::VectorXd::NullaryExpr(static_cast<Eigen::Index>(random() % max_contacts), size);
  confidence.inconsistencies = static_cast<std::int64_t>(random() >> 1U);
  confidence.last.t = t;
  confidence.last.contact = contact;
  confidence.last.suspicion = static_cast<Suspicion>(random() % 4);
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

void expect_equal(const Confidence& a, const Confidence& b) {
  EXPECT_EQ(a.has_replica, b.has_replica);
  EXPECT_EQ(a.has_filter, b.has_filter);
  EXPECT_EQ(a.from_filter, b.from_filter);
  EXPECT_EQ(a.bound, b.bound);
  EXPECT_EQ(a.sigma_q, b.sigma_q);
  EXPECT_EQ(a.sigma_u, b.sigma_u);
  EXPECT_EQ(a.sigma_g, b.sigma_g);
  EXPECT_EQ(a.replica.t, b.replica.t);
  EXPECT_EQ(a.replica.contact, b.replica.contact);
  EXPECT_EQ(a.replica.gap, b.replica.gap);
  EXPECT_EQ(a.filter.t, b.filter.t);
  EXPECT_EQ(a.filter.gap, b.filter.gap);
  EXPECT_EQ(a.filter.deviation, b.filter.deviation);
  EXPECT_EQ(a.inconsistencies, b.inconsistencies);
  EXPECT_EQ(a.last.t, b.last.t);
  EXPECT_EQ(a.last.contact, b.last.contact);
  EXPECT_EQ(a.last.suspicion, b.last.suspicion);
}

estimate_t lcm_estimate(const EstimateSample& sample) {
  const Confidence& confidence = sample.confidence;
  const bool closed_once = confidence.replica.t >= 0.0;
  estimate_t message{};
  message.settled_tick = sample.settled_tick;
  message.estimators =
      static_cast<std::int8_t>((confidence.has_replica ? 1 : 0) | (confidence.has_filter ? 2 : 0));
  message.from_filter = confidence.from_filter ? 1 : 0;
  message.bound = confidence.bound;
  message.deviations = static_cast<std::int32_t>(confidence.sigma_q.size());
  message.sigma_q.assign(confidence.sigma_q.begin(), confidence.sigma_q.end());
  message.sigma_u.assign(confidence.sigma_u.begin(), confidence.sigma_u.end());
  message.gaps = static_cast<std::int32_t>(confidence.sigma_g.size());
  message.sigma_g.assign(confidence.sigma_g.begin(), confidence.sigma_g.end());
  message.closing = confidence.replica.t;
  message.closing_contact = closed_once ? confidence.replica.contact + 1 : 0;
  message.replica_gap = confidence.replica.gap;
  message.filter_gap = confidence.filter.gap;
  message.sigma_filter_gap = confidence.filter.deviation;
  message.inconsistencies = confidence.inconsistencies;
  message.suspect_t = confidence.last.t;
  message.suspect_contact = confidence.last.t >= 0.0 ? confidence.last.contact + 1 : 0;
  message.suspicion = static_cast<std::int8_t>(confidence.last.suspicion);
  return message;
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

TEST(StateCodecTest, TypeHashesAreStable) {
  EXPECT_EQ(static_cast<std::uint64_t>(state_t::getHash()), 0x44a6bbc1c0625fe8U);
  EXPECT_EQ(static_cast<std::uint64_t>(estimate_t::getHash()), 0x504509d031a6ed1U);
}

TEST(StateCodecTest, RandomSamplesRoundTripAndMatchLcmEncoding) {
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

    EXPECT_EQ(copy(encode(sample, buffer)), lcm_bytes(sample, lcm_estimate(sample)));
    ASSERT_EQ(decode(buffer, estimate), Refusal::none);
    expect_equal(sample, estimate);
    EXPECT_EQ(estimate.settled_tick, sample.settled_tick);
    expect_equal(sample.confidence, estimate.confidence);
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

TEST(StateCodecTest, WrongLengthsAreRefusedBeforeStoring) {
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
  sample = good;
  sample.confidence.bound = std::numeric_limits<double>::infinity();
  EXPECT_EQ(refusal(sample), Refusal::none);
  const auto spoilt = [&](auto&& spoil) {
    EstimateSample bad = good;
    bad.confidence.has_filter = true;
    bad.confidence.sigma_q = bad.confidence.sigma_u = Eigen::VectorXd::Ones(2);
    bad.confidence.sigma_g = Eigen::VectorXd::Ones(1);
    EXPECT_EQ(refusal(bad), Refusal::none);
    spoil(bad.confidence);
    return refusal(bad);
  };
  // Without a claim.
  EXPECT_EQ(spoilt([](Confidence& c) {
              for (auto* sigma : {&c.sigma_q, &c.sigma_u, &c.sigma_g}) sigma->setConstant(infinity);
              c.filter.deviation = infinity;
            }),
            Refusal::none);
  EXPECT_EQ(spoilt([](Confidence& c) { c.filter.deviation = std::nan(""); }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.bound = -1.0; }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.bound = std::nan(""); }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.sigma_q[1] = -1e-9; }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.sigma_u[0] = std::nan(""); }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.sigma_g[0] = -1.0; }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.filter.gap = std::nan(""); }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.inconsistencies = -1; }), Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.last.suspicion = static_cast<Suspicion>(4); }),
            Refusal::bad_value);
  EXPECT_EQ(spoilt([](Confidence& c) { c.sigma_q = c.sigma_u = Eigen::VectorXd::Ones(1); }),
            Refusal::bad_count);
  EXPECT_EQ(spoilt([](Confidence& c) { c.sigma_g = Eigen::VectorXd::Ones(max_contacts + 1); }),
            Refusal::bad_count);
}

}  // namespace
}  // namespace sprag
