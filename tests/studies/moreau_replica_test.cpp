#include "studies/convergence/moreau_replica.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <vector>

#include "sprag/detail/replica/replica.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

TEST(MoreauReplica, ErrorEnergyFloorDecreasesWithTick) {
  const Scene scene = shipped_scene("paper_beam");
  std::vector<double> log_h;
  std::vector<double> log_V;
  for (const double h : {1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4}) {
    Pair<MoreauReplica> pair(scene, h);
    while (pair.t() < 150.0) pair.step();
    double sum = 0.0;
    int count = 0;
    while (pair.t() < 200.0) {
      pair.step();
      sum += std::log10(pair.V());
      ++count;
    }
    log_h.push_back(std::log10(h));
    log_V.push_back(sum / count);
  }
  const auto n = static_cast<double>(log_h.size());
  double mean_h = 0.0;
  double mean_V = 0.0;
  for (std::size_t i = 0; i < log_h.size(); ++i) {
    mean_h += log_h[i] / n;
    mean_V += log_V[i] / n;
  }
  double covariance = 0.0;
  double variance = 0.0;
  for (std::size_t i = 0; i < log_h.size(); ++i) {
    covariance += (log_h[i] - mean_h) * (log_V[i] - mean_V);
    variance += (log_h[i] - mean_h) * (log_h[i] - mean_h);
    std::cout << "moreau h = 1e" << log_h[i] << ": mean log10 V = " << log_V[i] << '\n';
  }
  const double slope = covariance / variance;
  std::cout << "moreau: V floor falls with slope " << slope << '\n';
  EXPECT_GT(slope, 1.0);
  EXPECT_LT(slope, 3.0);
}

TEST(MoreauReplica, IsSecondOrderWithoutImpacts) {
  Scene scene = shipped_scene("paper_beam");
  const auto error = [&](double h) {
    MoreauReplica moreau(scene.model, h);
    Replica exact(scene.model, h);
    MoreauReplica::State m;
    Replica::State e;
    moreau.start(scene.prior.start, 0, 0, m);
    exact.start(scene.prior.start, 0, 0, e);
    double worst = 0.0;
    Eigen::VectorXd q_m(3), u_m(3), q_e(3), u_e(3);
    for (int k = 0; k < static_cast<int>(std::lround(2.0 / h)); ++k) {
      moreau.tick({}, m);
      exact.tick({}, e);
      moreau.output(m, q_m, u_m);
      exact.output(e, q_e, u_e);
      worst = std::max(worst, (q_m - q_e).norm());
    }
    return worst;
  };
  for (const double h : {2e-3, 1e-3, 5e-4, 2.5e-4}) {
    EXPECT_NEAR(std::log2(error(h) / error(h / 2)), 2.0, 0.1) << "h = " << h;
  }
}

}  // namespace
}  // namespace sprag::test
