// Would catch a type that does not round-trip, changed its hash, or passes with impossible content.
#include "lcmtypes/messages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "lcmtypes/bus.h"
#include "tests/support/random_messages.h"

namespace sprag::test {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <class Message>
class Messages : public testing::Test {};
using Types = testing::Types<contacts_t, input_t, state_t, estimate_t, outputs_t, parameters_t,
                             bounds_t, health_t>;
TYPED_TEST_SUITE(Messages, Types);

TYPED_TEST(Messages, RandomMessagesReturnUnchanged) {
  Random random(2);
  TypeParam message{}, read{};
  std::vector<std::uint8_t> buffer, again;
  for (int i = 0; i < 500; ++i) {
    fill(random, message);
    const auto bytes = encode(message, buffer);
    ASSERT_EQ(name(decode(bytes, read)), "none");
    ASSERT_TRUE(std::ranges::equal(encode(read, again), bytes)) << i;
  }
}

TYPED_TEST(Messages, EveryCutIsTruncatedAndEveryOtherTypeIsRefused) {
  Random random(7);
  TypeParam message{};
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < 5; ++i) {
    fill(random, message);
    encode(message, bytes);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      // In a separate allocation, so that a sanitizer detects reading past its end.
      const std::vector<std::uint8_t> cut(bytes.begin(),
                                          bytes.begin() + static_cast<std::ptrdiff_t>(size));
      ASSERT_EQ(name(decode(cut, message)), "truncated") << size;
    }
    bytes.push_back(0);
    EXPECT_EQ(decode(bytes, message), Refusal::oversized);
    bytes[3] ^= 1U;
    EXPECT_EQ(decode(bytes, message), Refusal::wrong_type);
  }
}

// Recordings of version 0.2 and of third parties depend on them. health_t has changed since.
TEST(MessageTypes, HashesAreStable) {
  const auto hash = [](std::int64_t value) { return static_cast<std::uint64_t>(value); };
  EXPECT_EQ(hash(contacts_t::getHash()), 0xcb9f618642cab9d1U);
  EXPECT_EQ(hash(input_t::getHash()), 0x38f090b3ee39bd92U);
  EXPECT_EQ(hash(state_t::getHash()), 0x44a6bbc1c0625fe8U);
  EXPECT_EQ(hash(estimate_t::getHash()), 0x504509d031a6ed1U);
  EXPECT_EQ(hash(outputs_t::getHash()), 0x9312d69a47e0abbbU);
  EXPECT_EQ(hash(parameters_t::getHash()), 0xc618826fcc09a00dU);
  EXPECT_EQ(hash(bounds_t::getHash()), 0x2081a4871017c6adU);
  EXPECT_EQ(hash(health_t::getHash()), 0x3bdea782e2285155U);
  EXPECT_EQ(hash(impact_t::getHash()), 0x98797055078fe3f8U);
  EXPECT_EQ(hash(prediction_t::getHash()), 0x3bc8f1e1448e457dU);
}

// LCM's header, the channel's name with its final zero, the message: one packet, never a fragment.
TEST(MessageTypes, ContactsAndInputsFitIntoOnePacket) {
  EXPECT_LT(8 + std::string(contacts_channel).size() + 1 +
                static_cast<std::size_t>(contacts_t{}.getEncodedSize()),
            1400U);
  EXPECT_LT(8 + std::string(input_channel).size() + 1 +
                static_cast<std::size_t>(input_t{}.getEncodedSize()),
            1400U);
}

/// A valid message, and what validate() says when it is changed.
template <class Message>
struct Checked {
  Message good{};

  explicit Checked(const std::function<void(Message&)>& set) {
    Random random(3);
    fill(random, good);
    set(good);
    EXPECT_EQ(name(validate(good)), "none");
  }

  std::string_view after(const std::function<void(Message&)>& spoil) const {
    Message bad = good;
    spoil(bad);
    return name(validate(bad));
  }
};

TEST(Validate, Contacts) {
  const Checked<contacts_t> checked([](contacts_t& m) {
    m.contacts = 3;
    m.closed = 4;
    m.records = 2;
    m.records_total = 5;
    m.t[0] = m.t[1] = 0.5;
    m.contact[0] = 1;
    m.contact[1] = 3;
    m.kind[0] = 1;
    m.kind[1] = 3;
    m.speed = unbounded;
  });
  for (const double bad : {0.0, -1.0, not_a_number}) {
    EXPECT_EQ(checked.after([&](auto& m) { m.speed = bad; }), "bad_speed");
  }
  for (const double bad : {-1e-9, unbounded, not_a_number}) {
    EXPECT_EQ(checked.after([&](auto& m) { m.horizon = bad; }), "bad_time");
    EXPECT_EQ(checked.after([&](auto& m) { m.t[0] = bad; }), "bad_time");
    EXPECT_EQ(checked.after([&](auto& m) { m.t[1] = bad; }), "bad_time");
  }
  EXPECT_EQ(checked.after([](auto& m) { m.t[1] = 0.4; }), "bad_time") << "out of order";
  EXPECT_EQ(checked.after([](auto& m) { m.t[2] = -1.0; }), "none") << "an unused record";
  EXPECT_EQ(checked.after([](auto& m) { m.contacts = 0; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.contacts = max_contacts + 1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.closed = 8; }), "bad_closed");
  EXPECT_EQ(checked.after([](auto& m) { m.closed = -1; }), "bad_closed");
  EXPECT_EQ(checked.after([](auto& m) { m.sequence = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.sequence = largest_number + 1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.records_total = 1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.records = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.records = 121; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.contact[1] = 0; }), "bad_contact");
  EXPECT_EQ(checked.after([](auto& m) { m.contact[1] = 4; }), "bad_contact");
  EXPECT_EQ(checked.after([](auto& m) { m.kind[0] = 0; }), "bad_kind");
  EXPECT_EQ(checked.after([](auto& m) { m.kind[0] = 4; }), "bad_kind");
}

TEST(Validate, Input) {
  const Checked<input_t> checked([](input_t& m) {
    m.channels = 3;
    m.n = 20;
    m.total = 40;
    std::fill(std::begin(m.value), std::end(m.value), 0.5);
  });
  EXPECT_EQ(checked.after([](auto& m) { m.dt = 0.0; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.dt = unbounded; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.t0 = not_a_number; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.channels = 0; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.channels = 9; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.n = 0; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.total = 19; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.sequence = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.total = 100, m.n = 50; }), "none");
  EXPECT_EQ(checked.after([](auto& m) { m.total = 100, m.n = 51; }), "bad_count") << "no room";
  EXPECT_EQ(checked.after([](auto& m) { m.value[59] = unbounded; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.value[60] = unbounded; }), "none") << "unused";
}

template <class Message>
void expect_state_checked(const Checked<Message>& checked) {
  for (const double bad : {unbounded, not_a_number}) {
    EXPECT_EQ(checked.after([&](auto& m) { m.t = bad; }), "bad_time");
    EXPECT_EQ(checked.after([&](auto& m) { m.q[1] = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.u[0] = bad; }), "bad_value");
  }
  EXPECT_EQ(checked.after([](auto& m) { m.t = -1.0; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.tick = -1; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.f = 0; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.closed = std::int64_t{1} << max_contacts; }),
            "bad_closed");
}

TEST(Validate, StateAndEstimate) {
  const auto set = [](auto& m) {
    m.f = 2;
    m.q = {1.0, 2.0};
    m.u = {3.0, 4.0};
  };
  expect_state_checked(Checked<state_t>([&](state_t& m) { set(m); }));
  const Checked<estimate_t> checked([&](estimate_t& m) {
    set(m);
    m.estimators = 3;
    m.deviations = 2;
    m.sigma_q = m.sigma_u = {1.0, unbounded};
    m.gaps = 1;
    m.sigma_g = {unbounded};
    m.bound = unbounded;
    m.sigma_filter_gap = unbounded;
  });
  expect_state_checked(checked);
  EXPECT_EQ(checked.after([](auto& m) { m.settled_tick = -2; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.deviations = 1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.gaps = max_contacts + 1; }), "bad_count");
  for (const double bad : {-1e-9, not_a_number}) {
    EXPECT_EQ(checked.after([&](auto& m) { m.bound = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.sigma_q[1] = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.sigma_u[0] = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.sigma_g[0] = bad; }), "bad_value");
  }
  for (const double bad : {unbounded, not_a_number}) {
    EXPECT_EQ(checked.after([&](auto& m) { m.closing = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.replica_gap = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.filter_gap = bad; }), "bad_value");
    EXPECT_EQ(checked.after([&](auto& m) { m.suspect_t = bad; }), "bad_value");
  }
  EXPECT_EQ(checked.after([](auto& m) { m.sigma_filter_gap = not_a_number; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.estimators = 4; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.from_filter = 2; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.closing_contact = -1; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.suspect_contact = max_contacts + 1; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.inconsistencies = -1; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.suspicion = 4; }), "bad_value");
}

TEST(Validate, OutputsParametersAndBounds) {
  const Checked<outputs_t> outputs([](outputs_t& m) {
    m.n = 1;
    m.name = {"tip"};
    m.value = {2.0};
    m.sigma = {unbounded};
  });
  EXPECT_EQ(outputs.after([](auto& m) { m.t = -1.0; }), "bad_time");
  EXPECT_EQ(outputs.after([](auto& m) { m.tick = -1; }), "bad_time");
  EXPECT_EQ(outputs.after([](auto& m) { m.name[0] = std::string(255, 'x'); }), "none");
  EXPECT_EQ(outputs.after([](auto& m) { m.name[0] = std::string(256, 'x'); }), "bad_count");
  EXPECT_EQ(outputs.after([](auto& m) { m.name.assign(1001, "x"); }), "bad_count");
  EXPECT_EQ(outputs.after([](auto& m) { m.value[0] = unbounded; }), "bad_value");
  EXPECT_EQ(outputs.after([](auto& m) { m.sigma[0] = -1.0; }), "bad_value");
  const Checked<parameters_t> parameters([](parameters_t& m) {
    m.n = 1;
    m.key = {"K"};
    m.value = {2.0};
    m.sigma = {unbounded};
  });
  EXPECT_EQ(parameters.after([](auto& m) { m.t = not_a_number; }), "bad_time");
  EXPECT_EQ(parameters.after([](auto& m) { m.value[0] = not_a_number; }), "bad_value");
  EXPECT_EQ(parameters.after([](auto& m) { m.accepted = unbounded; }), "bad_value");
  EXPECT_EQ(parameters.after([](auto& m) { m.known = not_a_number; }), "bad_value");
  EXPECT_EQ(parameters.after([](auto& m) { m.identifications = -1; }), "bad_value");
  const Checked<bounds_t> bounds([](bounds_t& m) {
    m.n = 1;
    m.name = {"q1"};
    m.half_width = {unbounded};
  });
  EXPECT_EQ(bounds.after([](auto& m) { m.t = -1.0; }), "bad_time");
  EXPECT_EQ(bounds.after([](auto& m) { m.bound = not_a_number; }), "bad_value");
  EXPECT_EQ(bounds.after([](auto& m) { m.refutations = -1; }), "bad_value");
  EXPECT_EQ(bounds.after([](auto& m) { m.half_width[0] = -1.0; }), "bad_value");
  EXPECT_EQ(bounds.after([](auto& m) { m.name.assign(1001, "x"); }), "bad_count");
}

TEST(Validate, Health) {
  const Checked<health_t> checked([](health_t& m) {
    m.causes = 2;
    m.cause = {"foreign", "bad_time"};
    m.refused = {1, 2};
    m.speed = unbounded;
  });
  EXPECT_EQ(checked.after([](auto& m) { m.t = -1.0; }), "none");
  EXPECT_EQ(checked.after([](auto& m) { m.tick = -2; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.t = -0.5; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.t = unbounded; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.period = not_a_number; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.latency_p50 = -1.0; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.latency_p99 = not_a_number; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.lateness_max = unbounded; }), "bad_time");
  EXPECT_EQ(checked.after([](auto& m) { m.real_time_factor = unbounded; }), "bad_speed");
  EXPECT_EQ(checked.after([](auto& m) { m.speed = not_a_number; }), "bad_speed");
  EXPECT_EQ(checked.after([](auto& m) { m.speed = -1.0; }), "bad_speed");
  EXPECT_EQ(checked.after([](auto& m) { m.last = 2; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.master = 4; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.input = 3; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.estimate = -1; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.latencies = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.sessions = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.unsent = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.refused[1] = -1; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.causes = 65; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.cause[0] = ""; }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.cause[1] = std::string(64, 'x'); }), "bad_count");
  EXPECT_EQ(checked.after([](auto& m) { m.cause[0] = "a\nb"; }), "bad_value");
  EXPECT_EQ(checked.after([](auto& m) { m.cause[0] = "\xc3\xa4"; }), "bad_value");
}

TEST(Decode, AnArrayThatIsNowEmptyIsCleared) {
  outputs_t message{};
  message.n = 1;
  message.name = {"tip"};
  message.value = message.sigma = {2.0};
  std::vector<std::uint8_t> bytes;
  outputs_t read{};
  ASSERT_EQ(decode(encode(message, bytes), read), Refusal::none);
  ASSERT_EQ(decode(encode(outputs_t{}, bytes), read), Refusal::none);
  EXPECT_TRUE(read.name.empty());
  EXPECT_TRUE(read.value.empty());
  EXPECT_TRUE(read.sigma.empty());
}

TEST(Decode, ANameEndsWithZero) {
  outputs_t message{};
  message.n = 1;
  message.name = {"tip"};
  message.value = message.sigma = {2.0};
  std::vector<std::uint8_t> bytes;
  encode(message, bytes);
  ASSERT_EQ(bytes[46 + 4 + 3], 0);
  bytes[46 + 4 + 3] = 'x';
  EXPECT_EQ(decode(bytes, message), Refusal::bad_value);
}

}  // namespace
}  // namespace sprag::test
