#include "lcmtypes/prediction_codec.h"

#include <gtest/gtest.h>

#include <sprag/prediction_t.hpp>

namespace sprag {
namespace {

TEST(PredictionCodec, LcmDecodesEncodedMessage) {
  Prediction prediction{0.5, 0.875, {}};
  prediction.events.push_back({0.75, 2, ContactEventKind::pulse, 0.125});
  prediction.events.push_back({0.875, 0, ContactEventKind::closes, 0.25});
  std::vector<std::uint8_t> buffer;
  for (const bool any : {true, false}) {
    if (!any) prediction.events.clear();
    const auto message = encode_prediction(prediction, -3, 5, buffer);
    prediction_t read;
    ASSERT_EQ(read.decode(message.data(), 0, static_cast<int>(message.size())),
              static_cast<int>(message.size()));
    EXPECT_EQ(read.session, -3);
    EXPECT_EQ(read.utime, 5);
    EXPECT_EQ(read.made_at, 0.5);
    EXPECT_EQ(read.certain_until, 0.875);
    ASSERT_EQ(read.count, any ? 2 : 0);
    if (!any) continue;
    EXPECT_EQ(read.t, (std::vector<double>{0.75, 0.875}));
    EXPECT_EQ(read.contact, (std::vector<std::int32_t>{3, 1}));
    EXPECT_EQ(read.kind, (std::vector<std::int8_t>{3, 1}));
    EXPECT_EQ(read.sigma, (std::vector<double>{0.125, 0.25}));
  }
}

}  // namespace
}  // namespace sprag
