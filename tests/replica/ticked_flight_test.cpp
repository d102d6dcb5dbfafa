// Would catch rounding of the phase that accumulates over ticks.
#include "sprag/detail/replica/ticked_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

constexpr double tick_length = 1e-3;

Scene paper_beam() { return read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml"); }

bool has_no_time(const Motion& motion) {
  return std::isnan(motion.t.hi) && std::isnan(motion.t.lo) && std::isnan(motion.t - at(0.0));
}

// An outdated time would be used without an error.
TEST(TickedFlight, ClearsTimeOfMotion) {
  const Flows flows(paper_beam().model);
  const TickedFlight flight(flows[0], tick_length);
  Motion motion;
  const State start = paper_beam().prior.start;
  flows[0].enter(start.q, start.u, at(0.0), Eigen::VectorXd(0), motion);
  TickedFlight::Anchor anchor;
  TickedFlight::set_anchor(motion, anchor);
  for (std::int64_t k = 1; k <= 200; ++k) {
    flight.step(k, motion, anchor);
    ASSERT_TRUE(has_no_time(motion)) << "tick " << k;
  }
  Motion exact;
  flows[0].enter(start.q, start.u, at(0.0), Eigen::VectorXd(0), exact);
  flows[0].propagate(exact, tick_instant(200, tick_length), exact);
  EXPECT_LE((motion.x.z - exact.x.z).abs().maxCoeff(), 1e-12 * exact.x.z.abs().maxCoeff());
  EXPECT_LE((motion.x.v - exact.x.v).abs().maxCoeff(), 1e-12 * exact.x.v.abs().maxCoeff());
}

// The phase of the excitation is exact after any number of ticks of any length.
TEST(TickedFlight, PhaseRoundingDoesNotAccumulate) {
  const Flows flows(paper_beam().model);
  const State start = paper_beam().prior.start;
  for (const double h : {1e-4, 1e-3, 1e-2, 0.1, 0.7}) {
    const TickedFlight flight(flows[0], h);
    Motion motion;
    flows[0].enter(start.q, start.u, at(0.0), Eigen::VectorXd(0), motion);
    TickedFlight::Anchor anchor;
    TickedFlight::set_anchor(motion, anchor);
    OscillatorState exact = motion.x;
    double worst = 0.0;
    for (std::int64_t k = 1; k <= 20000; ++k) {
      flight.step(k, motion, anchor);
      flows[0].set_phases(tick_instant(k, h), exact);
      worst = std::max(worst, std::abs(motion.x.z[0] - exact.z[0]));
    }
    EXPECT_LE(worst, 2e-14) << "h = " << h;
  }
}

// After any number of free ticks the time at an event is that of its own tick.
template <typename Stepper>
void has_its_time_again(Stepper& stepper) {
  for (const std::int64_t ticks : {1, 63, 64, 65, 200}) {
    SCOPED_TRACE(ticks);
    typename Stepper::State state;
    stepper.start(paper_beam().prior.start, 0, 0, state);
    for (std::int64_t k = 0; k < ticks; ++k) stepper.tick({}, state);
    ASSERT_TRUE(has_no_time(state.motion));
    const ContactEvent event{(static_cast<double>(ticks) + 0.5) * tick_length, 0,
                             ContactEventKind::pulse};
    stepper.open_tick(state);
    EXPECT_EQ(state.motion.t - tick_instant(ticks, tick_length), 0.0);
    stepper.take({&event, 1}, state);
    EXPECT_EQ(state.motion.t - at(event.t), 0.0);
    stepper.close_tick(state);
    EXPECT_EQ(state.motion.t - tick_instant(ticks + 1, tick_length), 0.0);
    EXPECT_TRUE(state.motion.x.z.isFinite().all() && state.motion.x.v.isFinite().all());
  }
}

TEST(TickedFlight, RestoresTimeAtReplicaEvent) {
  Replica replica(paper_beam().model, tick_length);
  has_its_time_again(replica);
}

}  // namespace
}  // namespace sprag
