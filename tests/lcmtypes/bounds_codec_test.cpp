// The bounds message compared with LCM's own codec, and rejected messages.
#include "lcmtypes/bounds_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <sprag/bounds_t.hpp>

namespace sprag {
namespace {

constexpr double unbounded = std::numeric_limits<double>::infinity();

EstimateSample bounded_sample() {
  EstimateSample sample;
  sample.session = 7;
  sample.utime = 11;
  sample.tick = 40;
  sample.t = 0.4;
  sample.confidence.bound = 1e-4;
  sample.confidence.refutations = 2;
  sample.confidence.bound_q = Eigen::Vector2d(1e-3, unbounded);
  sample.confidence.bound_g = Eigen::VectorXd::Constant(1, 2e-3);
  sample.confidence.bound_outputs = Eigen::VectorXd::Constant(1, 3e-3);
  return sample;
}

const std::vector<Output>& tip_output() {
  static const std::vector<Output> outputs{{"tip", Eigen::Vector2d(1.0, 0.0), false}};
  return outputs;
}

TEST(BoundsCodec, AgreesWithLcm) {
  std::vector<std::uint8_t> buffer;
  const auto message = encode_bounds(bounded_sample(), tip_output(), buffer);
  bounds_t read;
  ASSERT_EQ(read.decode(message.data(), 0, static_cast<int>(message.size())),
            static_cast<int>(message.size()));
  EXPECT_EQ(read.session, 7);
  EXPECT_EQ(read.tick, 40);
  EXPECT_EQ(read.bound, 1e-4);
  EXPECT_EQ(read.refutations, 2);
  EXPECT_EQ(read.name, (std::vector<std::string>{"q1", "q2", "g1", "tip"}));
  EXPECT_EQ(read.half_width, (std::vector<double>{1e-3, unbounded, 2e-3, 3e-3}));
  BoundsSample own;
  ASSERT_EQ(decode(message, own), Refusal::none);
  EXPECT_EQ(own.names, read.name);
  EXPECT_EQ(own.half_widths, read.half_width);
  EXPECT_EQ(own.t, 0.4);
  EXPECT_EQ(own.refutations, 2);
}

TEST(BoundsCodec, RefusesTruncationsAndImpossibleNumbers) {
  std::vector<std::uint8_t> buffer;
  const auto message = encode_bounds(bounded_sample(), tip_output(), buffer);
  BoundsSample own;
  for (std::size_t size = 0; size < message.size(); ++size) {
    EXPECT_NE(decode(message.first(size), own), Refusal::none) << size;
  }
  EstimateSample wrong = bounded_sample();
  wrong.confidence.bound_q[0] = -1.0;
  std::vector<std::uint8_t> other;
  EXPECT_EQ(decode(encode_bounds(wrong, tip_output(), other), own), Refusal::bad_value);
  wrong = bounded_sample();
  wrong.confidence.bound = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(decode(encode_bounds(wrong, tip_output(), other), own), Refusal::bad_value);
  std::vector<std::uint8_t> longer(message.begin(), message.end());
  longer.push_back(0);
  EXPECT_EQ(decode(longer, own), Refusal::oversized);
}

}  // namespace
}  // namespace sprag
