// A stop token ends the call that it was given to, and no other.
#include <gtest/gtest.h>

#include <stop_token>
#include <thread>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/simulate.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

// Takes minutes.
constexpr double endless = 1e9;

TEST(StopToken, EndsItsOwnCallOnly) {
  const Scene scene = shipped_scene("paper_beam");
  std::stop_source source;
  bool interrupted_first = false;
  std::thread first([&] {
    EXPECT_THROW(simulate(scene.model, scene.truth.start, endless, 0.0, source.get_token()),
                 Interrupted);
    interrupted_first = true;
  });
  source.request_stop();
  const Simulation other = simulate(scene.model, scene.truth.start, 20.0, 0.0);
  EXPECT_FALSE(other.events.empty());
  first.join();
  EXPECT_TRUE(interrupted_first);
  EXPECT_FALSE(interrupted());
}

TEST(StopToken, KeepsTokenOfEnclosingScope) {
  const Scene scene = shipped_scene("paper_beam");
  std::stop_source source;
  source.request_stop();
  {
    const StopScope scope(source.get_token());
    EXPECT_THROW(simulate(scene.model, scene.truth.start, endless, 0.0), Interrupted);
    std::stop_source inner;
    EXPECT_NO_THROW(simulate(scene.model, scene.truth.start, 20.0, 0.0, inner.get_token()));
  }
  EXPECT_NO_THROW(simulate(scene.model, scene.truth.start, 20.0, 0.0));
}

}  // namespace
}  // namespace sprag::test
