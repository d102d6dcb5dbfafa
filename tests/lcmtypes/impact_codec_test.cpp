#include "lcmtypes/impact_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <sprag/impact_t.hpp>

namespace sprag {
namespace {

TEST(ImpactCodec, LcmDecodesEncodedMessage) {
  ImpactRecord record;
  record.t = 0.25;
  record.contact = 2;
  record.kind = ContactEventKind::opens;
  record.from_filter = record.sustained = true;
  record.time = {0.26, 1e-3};
  record.before = {-1.0, 0.5};
  record.after = {1.5, 0.25};
  record.impulse = {2.0, std::numeric_limits<double>::infinity()};
  record.force_begin = {3.0, 0.1};
  record.force_end = {4.0, 0.2};
  record.force_largest = {5.0, 0.3};
  record.force_impulse = {6.0, 0.4};
  std::vector<std::uint8_t> buffer;
  const auto message = encode_impact(record, -3, 5, buffer);
  impact_t read;
  ASSERT_EQ(read.decode(message.data(), 0, static_cast<int>(message.size())),
            static_cast<int>(message.size()));
  EXPECT_EQ(read.session, -3);
  EXPECT_EQ(read.utime, 5);
  EXPECT_EQ(read.t, 0.25);
  EXPECT_EQ(read.contact, 3);
  EXPECT_EQ(read.kind, 2);
  EXPECT_EQ(read.from_filter, 1);
  EXPECT_EQ(read.sustained, 1);
  const auto expect_pair = [](const double(&pair)[2], const Uncertain& x) {
    EXPECT_EQ(pair[0], x.value);
    EXPECT_EQ(pair[1], x.sigma);
  };
  expect_pair(read.time, record.time);
  expect_pair(read.velocity_before, record.before);
  expect_pair(read.velocity_after, record.after);
  expect_pair(read.impulse, record.impulse);
  expect_pair(read.force_begin, record.force_begin);
  expect_pair(read.force_end, record.force_end);
  expect_pair(read.force_largest, record.force_largest);
  expect_pair(read.force_impulse, record.force_impulse);
}

}  // namespace
}  // namespace sprag
