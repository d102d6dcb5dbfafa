#include "lcmtypes/outputs_codec.h"

#include <gtest/gtest.h>

#include <limits>
#include <sprag/outputs_t.hpp>

namespace sprag {
namespace {

TEST(OutputsCodec, LcmReadsWhatIsWritten) {
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
  }
  // Without a filter nothing is known.
  sample.confidence.sigma_outputs.resize(0);
  const auto message = encode_outputs(sample, true, outputs, buffer);
  outputs_t read;
  ASSERT_GT(read.decode(message.data(), 0, static_cast<int>(message.size())), 0);
  EXPECT_EQ(read.sigma, (std::vector<double>{infinity, infinity}));
}

}  // namespace
}  // namespace sprag
