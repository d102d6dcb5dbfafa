// Would catch a flight that overlooks a zero of a gap, or searches for one without end.
#include "sprag/detail/filter/model_flight.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"
#include "tests/support/shaken_by_record.h"

namespace sprag {
namespace {

double lowest_gap(const ModelFlight& flight) {
  double lowest = infinity;
  for (int i = 0; i < flight.contacts(); ++i) lowest = std::min(lowest, flight.gap(i).g);
  return lowest;
}

// Up to the returned time no sampled gap is negative. Then the search has been repeated until it
// finds nothing more.
TEST(ModelFlight, IsOpenUpToTheNextZeroOfAGap) {
  constexpr std::uint64_t first_seed = 300;
  int zeros = 0;
  for (int k = 0; k < repetitions(40); ++k) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(k);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const ImpactingMachine machine = random_impacting_machine(random);
    ModelFlight flight(std::make_shared<Flows>(machine.model));
    Eigen::VectorXd x(2 * flight.n());
    flight.enter(machine.start.q, machine.start.u, 0.0, x);
    flight.fly(x, 0.0, 0.0, 0);
    double end = 0.0;
    constexpr double longest = 50.0;
    while (lowest_gap(flight) > 0.0 && end < longest) {
      const double open = std::min(flight.open_for(), longest);
      constexpr int samples = 200;
      for (int j = 1; j < samples; ++j) {
        flight.fly(x, 0.0, end + open * j / samples, 0);
        EXPECT_GT(lowest_gap(flight), 0.0) << "at " << end + open * j / samples;
      }
      if (!(open > 1e-9)) break;
      end += open;
      flight.fly(x, 0.0, end, 0);
    }
    if (end >= longest) continue;
    ++zeros;
    EXPECT_NEAR(lowest_gap(flight), 0.0, 1e-9) << "at " << end;
  }
  EXPECT_GT(zeros, repetitions(40) / 4);
}

// A support that moves for ever just below the machine: the search of one call is short.
TEST(ModelFlight, SearchesForAZeroAtBoundedCost) {
  Model model;
  model.M = model.K = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Zero(1, 1);
  Contact& contact = model.contacts.emplace_back();
  contact.w = Eigen::VectorXd::Ones(1);
  contact.clearance = 1.0;
  contact.motion = {0.99, 1e6, 0.0};
  ModelFlight flight(std::make_shared<Flows>(model));
  const Eigen::VectorXd x = Eigen::VectorXd::Zero(2);
  flight.fly(x, 0.0, 0.0, 0);
  const double open = flight.open_for();
  EXPECT_GT(open, 1e-7);
  EXPECT_LT(open, 1e-3);
}

TEST(ModelFlight, IsOpenForNoKnownTimeUnderASampledInput) {
  const Scene scene = test::shaken_by_record(test::shipped_scene("paper_beam"), 0.02, 21.0);
  ModelFlight flight(std::make_shared<Flows>(scene.model));
  Eigen::VectorXd x(2 * flight.n());
  flight.enter(scene.truth.start.q, scene.truth.start.u, 0.0, x);
  flight.fly(x, 0.0, 0.0, 0);
  EXPECT_EQ(flight.open_for(), 0.0);
}

// A flight of duration 0 changes nothing, also at the time of the previous one, and under an input
// whose value depends on the time.
TEST(ModelFlight, DoesNotMoveWithinNoTime) {
  for (const bool sampled : {false, true}) {
    const Scene beam = test::shipped_scene("paper_beam");
    const Scene scene = sampled ? test::shaken_by_record(beam, 0.02, 21.0) : beam;
    ModelFlight flight(std::make_shared<Flows>(scene.model));
    Eigen::VectorXd x(2 * flight.n());
    flight.enter(scene.truth.start.q, scene.truth.start.u, 0.0, x);
    flight.fly(x, 0.0, 0.25, 0);
    const Eigen::VectorXd moved = flight.x();
    const Flight::Gap gap = flight.gap(0);
    flight.fly(moved, 0.25, 0.0, 0);
    EXPECT_EQ(flight.x(), moved);
    EXPECT_EQ(flight.gap(0).g, gap.g);
    EXPECT_EQ(flight.gap(0).velocity, gap.velocity);
    flight.fly(moved, 0.5, 0.0, 0);
    EXPECT_NE(flight.gap(0).g, gap.g);
  }
}

}  // namespace
}  // namespace sprag
