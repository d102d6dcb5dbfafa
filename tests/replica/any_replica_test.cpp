// The replica whose type is chosen at run time, compared with the replica of that type.
#include "sprag/detail/replica/any_replica.h"

#include <gtest/gtest.h>

#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

constexpr double step_length = 0.02;
constexpr double duration = 20.0;

/// A run tick by tick with the same events in both; the state is copied away and back during it.
template <Estimator E>
void expect_same(StepperKind stepper) {
  Scene scene = cached_scene("two_stops_beam.toml");
  scene.prior.uncertainty = Eigen::VectorXd::Constant(scene.model.coordinates(), 1e-3);
  const Eigen::Index f = scene.model.coordinates();
  const std::vector<ContactEvent> events = master_events(scene, duration);
  ASSERT_GT(events.size(), 20U);
  E typed(scene, step_length);
  AnyReplica any(scene, step_length, stepper);
  EXPECT_EQ(any.h(), typed.h());
  typename E::State typed_state;
  AnyReplica::State state, other;
  typed.start(scene.prior.start, 0, 0, typed_state);
  any.start(scene.prior.start, 0, 0, state);
  Confidence expected = typed.no_confidence(), actual = any.no_confidence();
  EXPECT_EQ(actual.has_replica, expected.has_replica);
  EXPECT_EQ(actual.has_filter, expected.has_filter);
  std::size_t next = 0;
  for (std::int64_t k = 1; k <= last_tick(duration, step_length); ++k) {
    const std::size_t first = next;
    while (next < events.size() && first_tick_after(events[next].t, step_length) <= k) ++next;
    const auto of_tick = std::span(events).subspan(first, next - first);
    typed.tick(of_tick, typed_state);
    other = state;
    any.tick(of_tick, other);
    ASSERT_EQ(state.tick, k - 1);
    state = other;
    ASSERT_EQ(state.tick, typed_state.tick);
    ASSERT_EQ(state.chi, typed_state.chi);
    Eigen::VectorXd q(f), u(f), expected_q(f), expected_u(f);
    any.output(state, q, u);
    typed.output(typed_state, expected_q, expected_u);
    ASSERT_TRUE(same_bits(q, expected_q) && same_bits(u, expected_u)) << "tick " << k;
    any.note(state, actual);
    typed.note(typed_state, expected);
    ASSERT_EQ(actual.replica.gap, expected.replica.gap);
  }
}

TEST(AnyReplica, EqualsWrappedReplicaBitForBit) {
  expect_same<Replica>(StepperKind::exact);
  expect_same<MoreauReplica>(StepperKind::moreau);
}

TEST(AnyReplica, NamesItsFlowPath) {
  const Scene& scene = cached_scene("paper_beam.toml");
  AnyReplica exact(scene, step_length);
  ASSERT_NE(exact.flows(), nullptr);
  EXPECT_STREQ(exact.flow_path(), "diagonal");
  AnyReplica moreau(scene, step_length, StepperKind::moreau);
  EXPECT_EQ(moreau.flows(), nullptr);
  EXPECT_STREQ(moreau.flow_path(), "moreau");
}

// A state of one estimator is invalid for another until start().
TEST(AnyReplica, StartAcceptsAnyState) {
  const Scene& scene = cached_scene("paper_beam.toml");
  AnyReplica moreau(scene, step_length, StepperKind::moreau);
  AnyReplica replica(scene, step_length);
  AnyReplica::State state;
  moreau.start(scene.prior.start, 0, 0, state);
  moreau.tick({}, state);
  replica.start(scene.prior.start, 5, 1, state);
  EXPECT_EQ(state.tick, 5);
  EXPECT_EQ(state.chi, 1U);
  replica.tick({}, state);
  EXPECT_EQ(state.tick, 6);
}

}  // namespace
}  // namespace sprag
