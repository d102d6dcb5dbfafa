// Detection of estimates inside a support: for random machines, in any units.
#include "sprag/detail/replica/penetration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/observer.h"
#include "sprag/simulate.h"
#include "tests/support/random_model.h"
#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

const Eigen::VectorXd unknown;

TEST(Penetration, IsTheLargestDepthInAnyUnit) {
  Random random(17);
  for (int machine = 0; machine < 100; ++machine) {
    SCOPED_TRACE(machine);
    const ImpactingMachine drawn = random_impacting_machine(random);
    const double length = length_scale(drawn.model, drawn.start);
    const double t = random.uniform(0.0, 10.0);
    const Eigen::VectorXd q = random.vector(drawn.model.coordinates());
    double deepest = 0.0;
    for (const Contact& contact : drawn.model.contacts) {
      deepest = std::max(deepest, -gap(contact, q, t));
    }
    const double found = penetration(drawn.model.contacts, q, t, unknown, length);
    EXPECT_NEAR(found, deepest, 1e-12);
    // In units of 2^-20 m.
    std::vector<Contact> scaled = drawn.model.contacts;
    for (Contact& contact : scaled) {
      contact.clearance *= 0x1p20;
      contact.motion.amplitude *= 0x1p20;
    }
    EXPECT_EQ(penetration(scaled, 0x1p20 * q, t, unknown, 0x1p20 * length), 0x1p20 * found);
  }
}

TEST(Penetration, IgnoresRoundingAndDepthWithinSigma) {
  std::vector<Contact> contacts(1);
  contacts[0].w = Eigen::VectorXd::Ones(1);
  const auto depth = [&](double q, double sigma) {
    return penetration(contacts, Eigen::VectorXd::Constant(1, q), 0.0,
                       Eigen::VectorXd::Constant(1, sigma), 2.0);
  };
  EXPECT_EQ(depth(0.5, 0.0), 0.0);
  EXPECT_EQ(depth(-1e-9, 0.0), 0.0);
  EXPECT_EQ(depth(-1e-8, 0.0), 1e-8);
  EXPECT_EQ(depth(-1e-3, 1e-3), 0.0);
  EXPECT_EQ(depth(-5e-3, 1e-3), 5e-3);
  EXPECT_EQ(depth(-5e-3, infinity), 5e-3) << "nothing is known of the gap";
}

// A replica that starts inside its support is marked from the first tick until it has converged. A
// filter's estimate is not marked if its sigma covers the depth; the machine's own start never is.
TEST(Penetration, MarksEstimatesOfAnObserver) {
  Scene scene = cached_scene("paper_beam.toml");
  scene.prior.start.q *= 2.0;
  ASSERT_LT(gap(scene.model.contacts[0], scene.prior.start.q, 0.0), -0.1);
  const Simulation machine = simulate(scene.model, scene.truth.start, 60.0, 0.01);
  for (const EstimatorKind kind : {EstimatorKind::replica, EstimatorKind::both}) {
    const Estimates all = observe(scene, machine.events, 60.0, {.tick = 0.01, .estimator = kind});
    const bool replica = kind == EstimatorKind::replica;
    EXPECT_EQ(all.penetrating.front(), replica ? 1 : 0);
    int marked = 0;
    for (Eigen::Index k = 0; k < all.t.size(); ++k) {
      const double g = gap(scene.model.contacts[0], all.q.row(k).transpose(), all.t[k]);
      if (all.penetrating[static_cast<std::size_t>(k)] != 0) {
        ++marked;
        EXPECT_LT(g, 0.0);
      } else if (all.of_filter[static_cast<std::size_t>(k)] == 0) {
        EXPECT_GT(g, -1e-8);
      }
    }
    EXPECT_GT(marked, replica ? 10 : -1);
  }
  scene.prior.start = scene.truth.start;
  const Estimates right = observe(scene, machine.events, 60.0, {.tick = 0.01});
  EXPECT_EQ(std::count(right.penetrating.begin(), right.penetrating.end(), 1), 0);
}

}  // namespace
}  // namespace sprag
