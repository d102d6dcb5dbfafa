#include "observer/estimation.h"

#include <gtest/gtest.h>

#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

ContactMessage heartbeat(double t) {
  ContactMessage message;
  message.contacts = 1;
  message.horizon = t;
  return message;
}

// A streamed excitation whose first sample comes after the session's start. The time line starts
// again at the first message for which the input is known, also if the machine's clock has jumped.
TEST(Estimation, StartsAgainWhereALateStreamBegins) {
  Scene scene = cached_scene("swept_beam.toml");
  scene.stream_duration = 10.0;
  ObserverOptions options;
  options.tick = 1e-2;
  for (const bool jumps : {false, true}) {
    SCOPED_TRACE(jumps);
    Estimation estimation(scene, options, 1000);
    estimation.restart(heartbeat(0.5));
    InputMessage samples;
    samples.t0 = 1.0;
    samples.dt = scene.model.forces[0].input->spacing();
    samples.total = samples.n = 10;
    estimation.stream->take(samples);
    EXPECT_FALSE(estimation.receive(heartbeat(0.9), false));
    EXPECT_EQ(estimation.time_line.first_tick(), 0);
    EXPECT_TRUE(estimation.receive(heartbeat(1.2), jumps));
    EXPECT_EQ(estimation.time_line.first_tick(), 121);
    EXPECT_FALSE(estimation.receive(heartbeat(1.3), jumps));
    EXPECT_EQ(estimation.time_line.first_tick(), 121);
  }
}

}  // namespace
}  // namespace sprag
