// Claimed sigma against true errors where the record of the excitation has noise: the machine moves
// under the clean record, the observer knows the noisy one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"
#include "tests/support/rattle.h"

namespace sprag {
namespace {

double standard_normal(Random& random) {
  double sum = -6.0;
  for (int i = 0; i < 12; ++i) sum += random.uniform(0.0, 1.0);
  return sum;
}

struct NoisyRattle {
  Scene machine, given;
};

// A shaken machine between two stops on the frame. The errors of the samples have a standard
// deviation of `share` of the rms.
NoisyRattle noisy_rattle(Random& random, Eigen::Index f, double share, double duration) {
  Scene scene = test::rattle(random, f);
  scene.prior.uncertainty = Eigen::VectorXd::Constant(f, 0.2);
  scene.prior.jitter = 1e-5;

  std::vector<double> t, clean, noisy;
  double squares = 0.0;
  for (int k = 0; k <= static_cast<int>(duration * 200.0); ++k) {
    t.push_back(0.005 * k);
    clean.push_back(3.0 * std::sin(t.back() * (5.0 + 0.1 * t.back())));
    squares += clean.back() * clean.back();
  }
  const double noise = share * std::sqrt(squares / static_cast<double>(clean.size()));
  for (const double a : clean) noisy.push_back(a + noise * standard_normal(random));
  NoisyRattle trial{scene, scene};
  trial.machine.model.forces.push_back(
      {test::across(f),
       0.0,
       {},
       std::make_shared<const SampledInput>(t, clean, SampledInput::Settings{})});
  trial.given.model.forces.push_back(
      {test::across(f),
       0.0,
       {},
       std::make_shared<const SampledInput>(t, noisy, SampledInput::Settings{.noise = noise})});
  return trial;
}

// Mean square of error over sigma.
struct Nees {
  double squares = 0.0;
  long count = 0;

  void add(const Eigen::VectorXd& error, const Eigen::VectorXd& sigma) {
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      if (!std::isfinite(sigma[i])) continue;
      const double z = error[i] / std::hypot(sigma[i], 1e-13);
      squares += z * z;
      ++count;
    }
  }
  double mean() const { return squares / static_cast<double>(count); }
};

void follow(const NoisyRattle& trial, const Scene& given, double duration, Nees& nees) {
  constexpr double h = 0.01;
  const Eigen::Index f = given.model.coordinates();
  TrackingEstimator estimator(given, h, EstimatorKind::both);
  TrackingState state;
  estimator.start(given.prior.start, 0, 0, state);
  Master master(trial.machine.model, trial.machine.truth.start);
  Confidence confidence = estimator.no_confidence();
  Eigen::VectorXd q(f), u(f), q_m(f), u_m(f);
  std::vector<ContactEvent> events;
  for (std::int64_t k = 1; tick_instant(k, h).hi < duration; ++k) {
    events.clear();
    master.advance(tick_instant(k, h), events);
    master.state(tick_instant(k, h), q_m, u_m);
    estimator.tick(events, state);
    if (k < 300) continue;  // the start no longer matters
    estimator.output(state, q, u);
    estimator.confidence(state, confidence);
    nees.add(q - q_m, confidence.sigma_q);
    nees.add(u - u_m, confidence.sigma_u);
  }
}

class NoisyRecord : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Shares, NoisyRecord, ::testing::Values(0.001, 0.01, 0.05));

TEST_P(NoisyRecord, SigmaMatchesErrors) {
  constexpr std::uint64_t seed = 51;
  constexpr double duration = 20.0;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Nees stated, ignored;
  for (int i = 0; i < 12; ++i) {
    const NoisyRattle trial = noisy_rattle(random, 1 + i % 2, GetParam(), duration + 1.0);
    follow(trial, trial.given, duration, stated);
    // Evidence that the trial can fail: the same record without its noise stated. The filter is
    // falsely certain, or its innovations fail their gates and it claims nothing.
    Scene without = trial.given;
    const SampledInput& input = *without.model.forces[0].input;
    std::vector<double> values;
    for (std::size_t k = 0; k < input.knots().size(); ++k) values.push_back(input.at_knot(k)[2]);
    without.model.forces[0].input =
        std::make_shared<const SampledInput>(input.knots(), values, SampledInput::Settings{});
    follow(trial, without, duration, ignored);
  }
  std::cout << "noise " << GetParam() << " of rms: NEES " << stated.mean() << " of " << stated.count
            << ", not stated: " << ignored.mean() << " of " << ignored.count << '\n';
  EXPECT_GT(stated.count, 10000);
  EXPECT_GT(stated.mean(), 0.5);
  EXPECT_LT(stated.mean(), 1.5);
  EXPECT_TRUE(10 * ignored.count < stated.count || ignored.mean() > 4.0);
}

}  // namespace
}  // namespace sprag
