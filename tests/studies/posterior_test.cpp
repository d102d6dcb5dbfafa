// The exact posterior, compared with a closed form, and with the filter's belief in an almost
// linear case.
#include "studies/posterior/posterior.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iostream>

#include "sprag/detail/mechanics/master.h"
#include "studies/calibration/machines.h"
#include "studies/common/random.h"
#include "studies/posterior/study.h"
#include "tests/support/process.h"
#include "tests/support/temporary_directory.h"

namespace sprag::posterior {
namespace {

constexpr double g = 9.81;
constexpr double epsilon = 0.8;

const Eigen::Vector2d fall(1.0, 0.0);    // [m], [m/s]
const Eigen::Vector2d wide(2e-3, 5e-3);  // sigma of the prior, far above that of the posterior

Model ball() {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({Eigen::VectorXd::Ones(1), -g, {}});
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, epsilon});
  return model;
}

// A ball hits the table at t_k = t_1 + 2 v / g (epsilon + ... + epsilon^(k-1)), v its speed at t_1.
// This is linear in both, as is its velocity after the last impact.
TEST(Posterior, OfBouncingBallIsLinear) {
  constexpr int impacts = 6;
  constexpr double jitter = 1e-5;
  const Flows flows(ball());
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Window window{0.0, 0.0, fall, fall + wide, wide.asDiagonal(), {}, {}};
    Master master(flows, {fall.head(1), fall.tail(1)}, 0.0, 0);
    ASSERT_FALSE(master.advance(at(1e3), window.events, impacts));
    window.end = window.events.back().t + 0.1;
    common::Random random(seed);
    Eigen::MatrixXd A(impacts, 2);
    Eigen::VectorXd reported(impacts);
    double sum = 0.0;
    for (int k = 0; k < impacts; ++k) {
      reported[k] = window.events[static_cast<std::size_t>(k)].t + jitter * random.normal();
      window.reported.push_back(reported[k]);
      A.row(k) << 1.0, 2.0 / g * sum;
      sum += std::pow(epsilon, k + 1);
    }
    const Eigen::Vector2d theta = A.colPivHouseholderQr().solve(reported);
    const Eigen::Matrix2d covariance = jitter * jitter * (A.transpose() * A).inverse();
    const Eigen::Vector2d slope(g, g * A(impacts - 1, 1) + std::pow(epsilon, impacts));
    const double mean = slope.dot(theta) - g * window.end;
    const double deviation = std::sqrt(slope.dot(covariance * slope));

    const auto found = moments(flows, window, jitter, 40000, seed);
    ASSERT_TRUE(found);
    std::cout << "seed " << seed << ": u off by " << (found->mean[1] - mean) / deviation
              << " deviations, deviation " << found->deviation[1] / deviation << ", accepted "
              << found->accepted << '\n';
    EXPECT_LT(std::abs(found->mean[1] - mean), 0.1 * deviation);
    EXPECT_NEAR(found->deviation[1] / deviation, 1.0, 0.06);
    EXPECT_GT(found->accepted, 0.2);
  }
}

// For events that the true state does not have.
TEST(Posterior, IsEmptyForOtherMachine) {
  const Flows flows(ball());
  Window window{0.0, 1.0, fall, fall, wide.asDiagonal(), {}, {}};
  Master master(flows, {fall.head(1), fall.tail(1)}, 0.0, 0);
  master.advance(at(1.0), window.events);
  ASSERT_EQ(window.events.size(), 1U);
  window.reported.assign(1, window.events.front().t);
  EXPECT_TRUE(moments(flows, window, 1e-3, 100, 1));
  window.events.push_back(window.events.front());
  window.reported.push_back(0.9);
  EXPECT_FALSE(moments(flows, window, 1e-3, 100, 1));
}

// Two methods that share only the flows, on other machines than the paper's beam.
TEST(Posterior, EqualsFilterForNearlyLinearMachines) {
  struct Case {
    std::string machine;
    double jitter;
  };
  for (const auto& [machine, jitter] : {Case{"random:1", 1e-5}, Case{"random:9", 1e-5}}) {
    const Scene scene = calibration::machines(machine).front();
    const Comparison of =
        compare(scene, jitter, {.seeds = 3, .instants = 5, .window = 20, .steps = 6000});
    std::cout << machine << ": " << of.instants << " instants, " << of.skipped
              << " skipped: sigma ratio " << of.sigma_ratio << ", means off by " << of.mean_off
              << '\n';
    EXPECT_GE(of.instants, 9);
    EXPECT_NEAR(of.sigma_ratio, 1.0, 0.1);
    EXPECT_LT(of.mean_off, 0.2);
  }
}

TEST(PosteriorProgram, PrintsARowForEachJitter) {
  const test::TemporaryDirectory directory;
  const auto run = [&](const std::string& jitter, int expected) {
    test::Process program({POSTERIOR, "random:1", "--jitter", jitter, "--seeds", "1", "--instants",
                           "2", "--steps", "400"},
                          directory / "", "posterior");
    EXPECT_EQ(program.wait(std::chrono::seconds(60)), expected) << program.err();
    const std::string out = program.out();
    return std::count(out.begin(), out.end(), '\n');
  };
  EXPECT_EQ(run("1e-4,1e-3", 0), 3);
  EXPECT_EQ(run("0", 2), 0);
}

}  // namespace
}  // namespace sprag::posterior
