#include "lcmtypes/parameters_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <sprag/parameters_t.hpp>

namespace sprag {
namespace {

TEST(ParametersCodec, LcmDecodesEncodedMessage) {
  EstimateSample sample;
  sample.session = -3;
  sample.utime = 5;
  sample.tick = 7;
  sample.t = 0.25;
  sample.confidence.from_filter = true;
  ParameterEstimates& parameters = sample.confidence.parameters;
  parameters.keys = std::make_shared<const std::vector<std::string>>(
      std::vector<std::string>{"impact.restitution", "", "K"});
  parameters.values = Eigen::Vector3d(0.7, -1.5, 1e300);
  parameters.sigmas = Eigen::Vector3d(0.01, std::numeric_limits<double>::infinity(), 0.0);
  parameters.accepted = 15.25;
  parameters.known = 16.5;
  parameters.identifications = 4;
  std::vector<std::uint8_t> buffer;
  const auto message = encode_parameters(sample, buffer);
  parameters_t read;
  ASSERT_EQ(read.decode(message.data(), 0, static_cast<int>(message.size())),
            static_cast<int>(message.size()));
  EXPECT_EQ(read.session, -3);
  EXPECT_EQ(read.utime, 5);
  EXPECT_EQ(read.tick, 7);
  EXPECT_EQ(read.t, 0.25);
  EXPECT_EQ(read.key, *parameters.keys);
  EXPECT_EQ(read.value, (std::vector<double>{0.7, -1.5, 1e300}));
  EXPECT_EQ(read.sigma, (std::vector<double>{0.01, std::numeric_limits<double>::infinity(), 0.0}));
  EXPECT_EQ(read.accepted, 15.25);
  EXPECT_EQ(read.known, 16.5);
  EXPECT_EQ(read.identifications, 4);
  EXPECT_EQ(read.from_filter, 1);
  ParametersSample own;
  ASSERT_EQ(decode(message, own), Refusal::none);
  EXPECT_EQ(own.session, -3);
  EXPECT_EQ(own.tick, 7);
  EXPECT_EQ(own.parameters.names, read.key);
  EXPECT_EQ(own.parameters.values, read.value);
  EXPECT_EQ(own.parameters.sigmas, read.sigma);
  EXPECT_EQ(own.accepted, 15.25);
  EXPECT_EQ(own.known, 16.5);
  EXPECT_EQ(own.identifications, 4);
  EXPECT_TRUE(own.from_filter);
}

}  // namespace
}  // namespace sprag
