#include "lcmtypes/outputs_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <sprag/outputs_t.hpp>

namespace sprag {
namespace {

TEST(OutputsCodec, LcmDecodesEncodedMessage) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EstimateSample sample;
  sample.session = -3;
  sample.utime = 5;
  sample.tick = 7;
  sample.t = 0.25;
  sample.q = Eigen::Vector2d(1.0, 2.0);
  sample.u = Eigen::Vector2d(-4.0, 8.0);
  sample.confidence.from_filter = true;
  sample.confidence.sigma_outputs = Eigen::Vector2d(0.5, infinity);
  const std::vector<Output> outputs{{"tip", Eigen::Vector2d(3.0, -1.0)},
                                    {"v", Eigen::Vector2d(0.0, 0.25), true}};
  std::vector<std::uint8_t> buffer;
  for (const bool settled : {false, true}) {
    const auto message = encode_outputs(sample, settled, outputs, buffer);
    outputs_t read;
    ASSERT_EQ(read.decode(message.data(), 0, static_cast<int>(message.size())),
              static_cast<int>(message.size()));
    EXPECT_EQ(read.session, -3);
    EXPECT_EQ(read.utime, 5);
    EXPECT_EQ(read.tick, 7);
    EXPECT_EQ(read.t, 0.25);
    EXPECT_EQ(read.settled, settled ? 1 : 0);
    EXPECT_EQ(read.from_filter, 1);
    EXPECT_EQ(read.name, (std::vector<std::string>{"tip", "v"}));
    EXPECT_EQ(read.value, (std::vector<double>{1.0, 2.0}));
    EXPECT_EQ(read.sigma, (std::vector<double>{0.5, infinity}));
    OutputsSample own;
    ASSERT_EQ(decode(message, own), Refusal::none);
    EXPECT_EQ(own.session, -3);
    EXPECT_EQ(own.tick, 7);
    EXPECT_EQ(own.t, 0.25);
    EXPECT_EQ(own.settled, settled);
    EXPECT_TRUE(own.from_filter);
    EXPECT_EQ(own.outputs.names, read.name);
    EXPECT_EQ(own.outputs.values, read.value);
    EXPECT_EQ(own.outputs.sigmas, read.sigma);
  }
  // Without a filter sigma is unknown.
  sample.confidence.sigma_outputs.resize(0);
  const auto message = encode_outputs(sample, true, outputs, buffer);
  outputs_t read;
  ASSERT_GT(read.decode(message.data(), 0, static_cast<int>(message.size())), 0);
  EXPECT_EQ(read.sigma, (std::vector<double>{infinity, infinity}));
}

TEST(OutputsCodec, ImpossibleValuesAreRefused) {
  EstimateSample sample;
  sample.q = sample.u = Eigen::Vector2d(1.0, 2.0);
  const std::vector<Output> outputs{{"tip", Eigen::Vector2d(3.0, -1.0)}};
  std::vector<std::uint8_t> buffer;
  const auto message = encode_outputs(sample, true, outputs, buffer);
  const std::vector<std::uint8_t> good(message.begin(), message.end());
  OutputsSample read;
  ASSERT_EQ(decode(good, read), Refusal::none);
  for (std::size_t size = 0; size < good.size(); ++size) {
    EXPECT_NE(decode(std::span(good).first(size), read), Refusal::none) << size;
  }
  std::vector<std::uint8_t> longer = good;
  longer.push_back(0);
  EXPECT_EQ(decode(longer, read), Refusal::oversized);
  constexpr std::size_t count = 42, name = 46;  // offsets of n and of the length of the first name
  const auto with = [&](std::size_t at, std::initializer_list<std::uint8_t> bytes) {
    std::vector<std::uint8_t> changed = good;
    std::copy(bytes.begin(), bytes.end(), changed.begin() + static_cast<std::ptrdiff_t>(at));
    return decode(changed, read);
  };
  EXPECT_EQ(with(0, {1, 2, 3}), Refusal::wrong_type);
  EXPECT_EQ(with(count, {0xff, 0xff, 0xff, 0xff}), Refusal::bad_count);
  EXPECT_EQ(with(count, {0x7f, 0xff, 0xff, 0xff}), Refusal::bad_count)
      << "no memory is taken for it";
  EXPECT_EQ(with(name, {0x7f, 0xff, 0xff, 0xff}), Refusal::bad_count);
  EXPECT_EQ(with(name, {0, 0, 0, 0}), Refusal::bad_count);
  EXPECT_EQ(with(name + 4 + 3, {'x'}), Refusal::bad_value) << "a name without its end";
  EXPECT_EQ(with(good.size() - 16, {0x7f, 0xf8}), Refusal::bad_value) << "no number";
  EXPECT_EQ(with(good.size() - 8, {0xbf, 0xf0}), Refusal::bad_value) << "a negative deviation";
  EXPECT_EQ(with(32, {0xbf, 0xf0}), Refusal::bad_time);
}

}  // namespace
}  // namespace sprag
