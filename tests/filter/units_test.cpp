// A machine in other units gives the same results, bit for bit: neither master nor estimators may
// contain a constant with a unit.
#include "tests/support/units.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scale.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

// Changes of units like mm, us and mg, in both directions.
constexpr std::array changes{Units{10, 0, 0},  Units{0, 7, 0},    Units{0, 0, 20},
                             Units{0, 0, -27}, Units{-9, -12, 5}, Units{20, 31, -11}};

std::string name_of(const Units& units) {
  return "length 2^" + std::to_string(units.length) + ", mass 2^" + std::to_string(units.mass) +
         ", time 2^" + std::to_string(units.time);
}

// Events and states of a run, as numbers in the original units.
struct Run {
  std::vector<ContactEvent> events;
  std::vector<Eigen::VectorXd> q, u;
  std::string error;
};

constexpr int samples = 50;

Run run_master(const Scene& scene, double T, const Units& units) {
  const Scene here = in_units(units, scene);
  Run run;
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  try {
    Master master(here.model, here.truth.start);
    for (int k = 0; k <= samples; ++k) {
      const Instant t = tick_instant(k, units.of_time(T / samples));
      if (!master.advance(t, run.events, 100000 - run.events.size())) break;
      master.state(t, q, u);
      run.q.push_back(q / units.of_length(1.0));
      run.u.push_back(u / units.of_velocity(1.0));
    }
  } catch (const SimulationError& error) {
    run.error = "no motion";
  }
  for (ContactEvent& event : run.events) event.t = std::ldexp(event.t, -units.time);
  return run;
}

template <Estimator E>
Run run_stepper(const Scene& scene, std::vector<ContactEvent> events, double T,
                const Units& units) {
  const Scene here = in_units(units, scene);
  const Eigen::Index f = scene.model.coordinates();
  const double h = units.of_time(T / samples);
  E estimator(here, h);
  typename E::State state;
  estimator.start(here.prior.start, 0, 0, state);
  for (ContactEvent& event : events) event.t = units.of_time(event.t);
  Confidence confidence = estimator.no_confidence();
  Run run;
  Eigen::VectorXd q(f), u(f);
  std::size_t next = 0;
  while (next < events.size() && events[next].t == 0.0) ++next;
  estimator.apply(std::span(events).first(next), state);
  for (int k = 1; k <= samples; ++k) {
    const std::size_t first = next;
    while (next < events.size() && events[next].t <= tick_instant(k, h).hi) ++next;
    estimator.tick(std::span(events).subspan(first, next - first), state);
    estimator.output(state, q, u);
    run.q.push_back(q / units.of_length(1.0));
    run.u.push_back(u / units.of_velocity(1.0));
    if constexpr (requires { estimator.confidence(state, confidence); }) {
      if (!confidence.has_filter) continue;
      estimator.confidence(state, confidence);
      run.q.push_back(confidence.sigma_q / units.of_length(1.0));
      run.u.push_back(confidence.sigma_u / units.of_velocity(1.0));
    }
  }
  return run;
}

void expect_same(const Run& a, const Run& b) {
  EXPECT_EQ(a.error, b.error);
  ASSERT_EQ(a.events.size(), b.events.size());
  for (std::size_t i = 0; i < a.events.size(); ++i) {
    ASSERT_EQ(a.events[i].t, b.events[i].t) << "event " << i;
    ASSERT_EQ(a.events[i].contact, b.events[i].contact) << "event " << i;
    ASSERT_EQ(a.events[i].kind, b.events[i].kind) << "event " << i;
  }
  ASSERT_EQ(a.q.size(), b.q.size());
  for (std::size_t i = 0; i < a.q.size(); ++i) {
    ASSERT_TRUE(a.q[i] == b.q[i]) << "q, row " << i << ": " << a.q[i].transpose() << " and "
                                  << b.q[i].transpose();
    ASSERT_TRUE(a.u[i] == b.u[i]) << "u, row " << i << ": " << a.u[i].transpose() << " and "
                                  << b.u[i].transpose();
  }
}

// Returns the number of events.
std::size_t check(const Scene& scene, double T) {
  const Run master = run_master(scene, T, {});
  const Run replica = run_stepper<Replica>(scene, master.events, T, {});
  const Run filter = run_stepper<TimingEstimator>(scene, master.events, T, {});
  const double own = time_scale(scene.model, scene.truth.start);
  for (const Units& units : changes) {
    SCOPED_TRACE(name_of(units));
    const Scene here = in_units(units, scene);
    EXPECT_EQ(time_scale(here.model, here.truth.start), units.of_time(own));
    {
      SCOPED_TRACE("master");
      expect_same(master, run_master(scene, T, units));
    }
    {
      SCOPED_TRACE("replica");
      expect_same(replica, run_stepper<Replica>(scene, master.events, T, units));
    }
    // Roots of M scale exactly only for even powers. With jitter the filter takes logarithms, which
    // scale up to rounding only.
    if (units.mass % 2 == 0 && scene.prior.jitter == 0.0) {
      SCOPED_TRACE("timing filter");
      expect_same(filter, run_stepper<TimingEstimator>(scene, master.events, T, units));
    }
    if (testing::Test::HasFailure()) break;
  }
  return master.events.size();
}

class ShippedInOtherUnits : public testing::TestWithParam<const char*> {};

TEST_P(ShippedInOtherUnits, AreTheSameBitForBit) {
  EXPECT_GT(check(test::shipped_scene(GetParam()), 10.0), 1U);
}

INSTANTIATE_TEST_SUITE_P(Scenes, ShippedInOtherUnits,
                         testing::Values("paper_beam", "paper_beam_chatter", "two_stops_beam",
                                         "bouncing_ball", "non_proportional", "lab_rig",
                                         "three_ball_chain", "impact_oscillator"),
                         [](const auto& of) { return std::string(of.param); });

class RandomInOtherUnits : public testing::TestWithParam<std::size_t> {};

TEST_P(RandomInOtherUnits, AreTheSameBitForBit) {
  std::size_t events = 0;
  for (int i = 0; i < 8; ++i) {
    const std::uint64_t seed = 60000 + 100 * GetParam() + static_cast<std::uint64_t>(i);
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Eigen::Index f = random.integer(1, 4);
    Scene scene;
    scene.model = random_machine(random, structures[GetParam()], f);
    add_forces(random, scene.model, random.integer(1, 2));
    add_contacts(random, scene.model, random.integer(1, 3));
    scene.truth.start = random_state(random, scene.model);
    scene.prior.start = random_state(random, scene.model);
    for (Contact& contact : scene.model.contacts) {
      contact.clearance += random.uniform(0.05, 0.5) - gap(contact, scene.truth.start.q, 0.0);
    }
    if (random.chance(0.5)) scene.prior.jitter = 1e-5;
    events += check(scene, 5.0);
    if (HasFailure()) return;
  }
  EXPECT_GT(events, 8U);
}

INSTANTIATE_TEST_SUITE_P(All, RandomInOtherUnits, testing::Range<std::size_t>(0, structures.size()),
                         [](const auto& of) { return std::string(structure_names[of.param]); });

}  // namespace
}  // namespace sprag
