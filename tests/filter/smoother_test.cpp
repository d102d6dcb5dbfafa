// Would catch a smoothed path less accurate than the filter, or with a wrong sigma.
#include "sprag/smoother.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "sprag/simulate.h"
#include "tests/support/jitter.h"
#include "tests/support/recorded_run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

struct SmoothingTrial {
  const char* scene;
  double sigma;
  double duration;
  double least_gain;   // filtered rms over smoothed rms
  double least_share;  // of smoothed ticks
  double drift = 0.0;
  unsigned seeds = 6;
  double misfit = 1.0;
};

std::vector<ContactEvent> off(const std::vector<ContactEvent>& events, double sigma,
                              unsigned seed) {
  std::mt19937_64 engine(seed);
  return test::jittered_together(events, sigma, 6.0, engine);
}

class SmoothedPath : public testing::TestWithParam<SmoothingTrial> {};

// Compared with the exact master, over runs with independent jitter.
TEST_P(SmoothedPath, IsMoreAccurateThanFilterAndCalibrated) {
  const SmoothingTrial& of = GetParam();
  Scene scene = cached_scene(of.scene);
  scene.prior.jitter = of.sigma;
  scene.prior.drift = of.drift;
  const double h = 0.0137;
  const Simulation truth = simulate(scene.model, scene.truth.start, of.duration, h);
  const Eigen::Index f = scene.model.coordinates();
  double smoothed = 0.0, filtered = 0.0, squares = 0.0, count = 0.0, far = 0.0;
  double misfit = 0.0;
  int stretches_of_all = 0;
  double share = 0.0;
  const unsigned seeds = of.seeds;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    const std::vector<ContactEvent> events = off(truth.events, of.sigma, seed);
    std::vector<SmoothedEstimate> estimates;
    const auto stretches = smooth(scene, events, h, truth.t.size() - 1,
                                  [&](std::int64_t, const SmoothedEstimate& estimate, bool clear) {
                                    share += clear ? 1.0 : 0.0;
                                    estimates.push_back(estimate);
                                  });
    for (const SmoothedStretch& stretch : stretches) {
      if (stretch.events < 20) continue;
      misfit += stretch.misfit;
      ++stretches_of_all;
    }
    TimingEstimator filter(scene, h);
    TrackingState state;
    filter.start(scene.prior.start, 0, 0, state);
    std::span<const ContactEvent> left = events;
    Eigen::VectorXd q(f), u(f);
    for (Eigen::Index k = 0; k < truth.t.size(); ++k) {
      if (k > 0) {
        std::size_t n = 0;
        while (n < left.size() && first_tick_after(left[n].t, h) <= k) ++n;
        filter.tick(left.first(n), state);
        left = left.subspan(n);
      }
      filter.output(state, q, u);
      const SmoothedEstimate& estimate = estimates[static_cast<std::size_t>(k)];
      const auto energy = [&](const Eigen::VectorXd& at_q, const Eigen::VectorXd& at_u) {
        const Eigen::VectorXd dq = at_q - truth.q.row(k).transpose();
        const Eigen::VectorXd du = at_u - truth.u.row(k).transpose();
        return 0.5 * (dq.dot(scene.model.K * dq) + du.dot(scene.model.M * du));
      };
      filtered += energy(q, u);
      smoothed += energy(estimate.q, estimate.u);
      for (Eigen::Index i = 0; i < f; ++i) {
        const double z_q = (estimate.q[i] - truth.q(k, i)) / estimate.sigma_q[i];
        const double z_u = (estimate.u[i] - truth.u(k, i)) / estimate.sigma_u[i];
        squares += z_q * z_q + z_u * z_u;
        far += (std::abs(z_q) > 3.0) + (std::abs(z_u) > 3.0);
        count += 2.0;
      }
    }
  }
  ASSERT_GT(stretches_of_all, 0);
  misfit /= stretches_of_all;
  share /= (static_cast<double>(seeds) * static_cast<double>(truth.t.size()));
  const double gain = std::sqrt(filtered / smoothed);
  std::cout << of.scene << " sigma " << of.sigma << " drift " << of.drift << ": gain " << gain
            << ", z^2 " << squares / count << ", beyond 3 sigma " << far / count << ", misfit "
            << misfit << ", smoothed " << share << '\n';
  EXPECT_GT(share, of.least_share);
  EXPECT_GT(gain, of.least_gain);
  EXPECT_GT(squares / count, 0.3);
  EXPECT_LT(squares / count, 1.5);
  EXPECT_LT(far / count, 0.02);
  EXPECT_NEAR(misfit, of.misfit, 0.3);
}
INSTANTIATE_TEST_SUITE_P(
    Machines, SmoothedPath,
    testing::Values(SmoothingTrial{"paper_beam.toml", 1e-4, 100.0, 3.0, 0.95},
                    SmoothingTrial{"paper_beam.toml", 1e-3, 60.0, 3.0, 0.9},
                    SmoothingTrial{"impact_oscillator.toml", 1e-3, 8.0, 1.0, 0.95, 0.0, 40},
                    SmoothingTrial{"two_stops_beam.toml", 1e-4, 20.0, 1.0, 0.02},
                    SmoothingTrial{"steel_ruler.toml", 1e-5, 5.0, 3.0, 0.1},
                    SmoothingTrial{"non_proportional.toml", 1e-4, 60.0, 3.0, 0.9},
                    SmoothingTrial{"paper_beam_frame.toml", 1e-4, 60.0, 3.0, 0.95},
                    // The machine does not drift, so that sigma is too large, also that of the
                    // innovations (misfit 0.63).
                    SmoothingTrial{"paper_beam.toml", 1e-4, 60.0, 3.0, 0.95, 1e-8, 6, 0.65}));

// The sigma of an output follows from the state's covariance by its weights, at impacts and between
// them.
TEST(Smoother, OutputSigmaFollowsFromStateCovariance) {
  for (const char* name : {"paper_beam.toml", "two_stops_beam.toml"}) {
    Scene scene = cached_scene(name);
    scene.prior.jitter = 1e-3;
    const Eigen::Index f = scene.model.coordinates();
    const auto e = [f](Eigen::Index i) -> Eigen::VectorXd { return Eigen::VectorXd::Unit(f, i); };
    const Eigen::VectorXd w = scene.model.contacts[0].w;
    scene.model.outputs = {
        {"second", e(1)}, {"speed", -2.0 * e(0), true}, {"gap", w}, {"v", w, true}};
    const Simulation truth = simulate(scene.model, scene.truth.start, 20.0, 0.0137);
    const std::vector<ContactEvent> events = off(truth.events, scene.prior.jitter, 4);
    std::int64_t smoothed = 0, filtered = 0;
    double squares = 0.0;
    smooth(scene, events, 0.0137, truth.t.size() - 1,
           [&](std::int64_t k, const SmoothedEstimate& estimate, bool clear) {
             ++(clear ? smoothed : filtered);
             const auto near = [&](Eigen::Index i, double sigma) {
               EXPECT_NEAR(estimate.sigma_outputs[i], sigma, 1e-6 * sigma + 1e-9) << name << k;
             };
             near(0, estimate.sigma_q[1]);
             near(1, 2.0 * estimate.sigma_u[0]);
             near(2, estimate.sigma_gap[0]);
             squares += std::pow(
                 w.dot(estimate.u - truth.u.row(k).transpose()) / estimate.sigma_outputs[3], 2);
           });
    std::cout << name << ": " << smoothed << " ticks smoothed, " << filtered
              << " not, mean of (error of v/sigma)^2 "
              << squares / static_cast<double>(smoothed + filtered) << '\n';
    EXPECT_GT(smoothed, 0);
    EXPECT_LT(squares, 2.0 * static_cast<double>(smoothed + filtered));
    EXPECT_GT(squares, 0.1 * static_cast<double>(smoothed + filtered));
  }
}

TEST(Smoother, RefusesExactTimesAndUnobservableScale) {
  Scene scene = cached_scene("paper_beam.toml");
  const auto none = [](std::int64_t, const SmoothedEstimate&, bool) {};
  EXPECT_THROW(smooth(scene, {}, 0.01, 10, none), SmoothingError);
  scene.prior.jitter = 1e-4;
  scene.model.forces.clear();
  scene.model.contacts[0].motion = {};
  scene.model.contacts[0].clearance = 0.0;
  EXPECT_THROW(smooth(scene, {}, 0.01, 10, none), SmoothingError);
}

// Times that no path has: nothing is smoothed and no sigma is claimed.
TEST(Smoother, EventsThatDoNotFitAreNotSmoothed) {
  Scene scene = cached_scene("paper_beam.toml");
  scene.prior.jitter = 1e-4;
  std::vector<ContactEvent> wrong;
  for (int i = 1; i < 40; ++i) {
    wrong.push_back({0.3137 * i + 0.1 * std::sin(7.0 * i), 0, ContactEventKind::pulse});
  }
  int claimed = 0;
  smooth(scene, wrong, 0.01, 1200, [&](std::int64_t k, const SmoothedEstimate& estimate, bool) {
    if (k > 400 && estimate.sigma_q.allFinite()) ++claimed;
  });
  EXPECT_EQ(claimed, 0);
}

}  // namespace
}  // namespace sprag
