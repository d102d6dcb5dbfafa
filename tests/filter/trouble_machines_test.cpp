// Machines that chatter, some with several contacts at once. With exact events and the right model
// the filter converges to the state, keeps its track, and is not overconfident about a wrong state.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

// `reported_start`: the scene specifies an uncertainty of the start of three times V(0); otherwise
// none.
void expect_not_taken_for_another(const std::string& name, bool reported_start) {
  Scene scene = read_scene(std::filesystem::path(SPRAG_SOURCE_DIR) / "tests/filter/machines" /
                           (name + ".toml"));
  const ErrorEnergy energy(scene.model);
  const Eigen::Index f = scene.model.coordinates();
  const Eigen::VectorXd V_i =
      energy(scene.truth.start.q, scene.truth.start.u, scene.prior.start.q, scene.prior.start.u)
          .tail(f);
  if (reported_start) scene.prior.uncertainty = 3.0 * V_i.array() + 1e-9 * V_i.sum();
  constexpr double h = 0.01;
  BothEstimator both(scene, h);
  TrackingState state;
  both.start(scene.prior.start, 0, 0, state);
  Confidence confidence = both.no_confidence();
  Master master(scene.model, scene.truth.start);
  Eigen::VectorXd q(f), u(f), q_m(f), u_m(f);
  std::vector<ContactEvent> events;
  double worst = 0.0, largest = 0.0;
  for (std::int64_t k = 1; k <= 4000; ++k) {
    events.clear();
    master.advance(tick_instant(k, h), events);
    both.tick(events, state);
    master.state(tick_instant(k, h), q_m, u_m);
    both.output(state, q, u);
    const double V = energy(q_m, u_m, q, u)[0];
    if (k > 3000) largest = std::max(largest, V);
    both.confidence(state, confidence);
    for (Eigen::Index i = 0; i < f; ++i) {
      worst = std::max({worst, std::abs(q[i] - q_m[i]) / confidence.sigma_q[i],
                        std::abs(u[i] - u_m[i]) / confidence.sigma_u[i]});
    }
  }
  std::cout << name << ": largest error " << worst << " sigma, V from t = 30 on " << largest
            << " of " << V_i.sum() << ", " << state.inconsistencies << " inconsistencies\n";
  EXPECT_LT(worst, 7.0);
  EXPECT_EQ(state.inconsistencies, 0);
  EXPECT_TRUE(state.track.status == TrackStatus::confirmed);
  EXPECT_LT(largest, 1e-3 * V_i.sum());
}

class ChatteringMachine : public testing::TestWithParam<const char*> {};

TEST_P(ChatteringMachine, HasNoFalseAlarm) { expect_not_taken_for_another(GetParam(), true); }

TEST_P(ChatteringMachine, HasNoFalseAlarmWithoutPrior) {
  expect_not_taken_for_another(GetParam(), false);
}

INSTANTIATE_TEST_SUITE_P(All, ChatteringMachine,
                         testing::Values("b025", "fc18", "s005", "s027", "b019"),
                         [](const auto& parameter) { return std::string(parameter.param); });

}  // namespace
}  // namespace sprag
