// The messages on SPRAG_INPUT: the same bytes as LCM's, and refusal of every bad field.
#include "lcmtypes/input_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sprag/input_t.hpp>
#include <vector>

namespace sprag {
namespace {

InputMessage message() {
  InputMessage of{.session = 5,
                  .sequence = 7,
                  .utime = 9,
                  .t0 = -0.25,
                  .dt = 0.002,
                  .total = 40,
                  .channels = 3,
                  .n = 20};
  for (std::size_t i = 0; i < 60; ++i) of.value[i] = 0.5 * static_cast<double>(i) - 3.0;
  return of;
}

TEST(InputCodec, WritesTheBytesOfLcm) {
  const InputMessage of = message();
  EncodedInput bytes;
  encode(of, bytes);
  input_t reference{};
  ASSERT_EQ(reference.decode(bytes.data(), 0, static_cast<int>(bytes.size())),
            static_cast<int>(bytes.size()));
  EXPECT_EQ(reference.session, 5);
  EXPECT_EQ(reference.t0, -0.25);
  EXPECT_EQ(reference.total, 40);
  EXPECT_EQ(reference.channels, 3);
  EXPECT_EQ(reference.n, 20);
  EXPECT_EQ(reference.value[59], of.value[59]);
  EXPECT_EQ(reference.value[60], 0.0);
  InputMessage back;
  ASSERT_EQ(decode(bytes, back), Refusal::none);
  EXPECT_EQ(back.first(), 20);
  EXPECT_EQ(back.sample(22), of.value[6]);
}

TEST(InputCodec, RefusesBadFields) {
  const auto refusal = [](auto&& spoil) {
    InputMessage of = message();
    spoil(of);
    EncodedInput bytes;
    InputMessage back;
    encode(of, bytes);
    return decode(bytes, back);
  };
  EXPECT_EQ(refusal([](InputMessage& of) { of.dt = 0.0; }), Refusal::bad_time);
  EXPECT_EQ(refusal([](InputMessage& of) { of.t0 = std::nan(""); }), Refusal::bad_time);
  EXPECT_EQ(refusal([](InputMessage& of) { of.channels = 0; }), Refusal::bad_count);
  EXPECT_EQ(refusal([](InputMessage& of) { of.n = 0; }), Refusal::bad_count);
  EXPECT_EQ(refusal([](InputMessage& of) { of.total = 19; }), Refusal::bad_count);
  EXPECT_EQ(refusal([](InputMessage& of) { of.sequence = -1; }), Refusal::bad_count);
  EXPECT_EQ(
      refusal([](InputMessage& of) { of.value[3] = std::numeric_limits<double>::infinity(); }),
      Refusal::bad_value);
  EncodedInput bytes;
  encode(message(), bytes);
  InputMessage back;
  EXPECT_EQ(decode(std::span(bytes).first(100), back), Refusal::truncated);
  bytes[3] ^= 1U;
  EXPECT_EQ(decode(bytes, back), Refusal::wrong_type);
}

// Three channels have room for 50 samples.
TEST(InputCodec, RefusesMoreValuesThanRoom) {
  EncodedInput bytes;
  InputMessage of = message();
  of.total = 100;
  encode(of, bytes);
  // n is the last entry before the values, big endian.
  bytes[8 + 6 * 8 + 4 + 3] = 51;
  InputMessage back;
  EXPECT_EQ(decode(bytes, back), Refusal::bad_count);
}

}  // namespace
}  // namespace sprag
