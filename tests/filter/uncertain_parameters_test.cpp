// Claimed sigma against true errors with uncertain parameters: machines with parameters drawn from
// the scene's [parameters], and jittered event times.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/energy.h"
#include "sprag/observer.h"
#include "sprag/scene_file.h"
#include "sprag/smoother.h"
#include "tests/support/random.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::shipped_scene;

constexpr std::int64_t ticks = 800;
constexpr std::int64_t first_tick = 120;  // the start no longer matters

double normal(Random& random) {
  double sum = -6.0;
  for (int i = 0; i < 12; ++i) sum += random.uniform(0.0, 1.0);
  return sum;
}

// A driven machine of `f` coordinates between two stops: M, K random, C = a M + b K.
Scene random_rattle(Random& random, Eigen::Index f, double share) {
  Scene scene;
  Model& model = scene.model;
  model.M = random.positive_definite(f, 0.8, 1.3);
  model.K = random.positive_definite(f, 15.0, 60.0);
  model.C = 0.2 * model.M + 0.004 * model.K;
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(f);
  direction[0] = 1.0;
  Harmonic harmonic;
  harmonic.amplitude = random.uniform(2.5, 3.5);
  harmonic.frequency = random.uniform(6.0, 8.0);
  model.forces.push_back({direction, 0.0, harmonic});
  for (const double side : {1.0, -1.0}) {
    Contact contact;
    contact.w = side * direction;
    contact.clearance = random.uniform(0.04, 0.06);
    contact.restitution = random.uniform(0.6, 0.8);
    model.contacts.push_back(contact);
  }
  model.contacts[1].restitution = model.contacts[0].restitution;
  scene.truth.start = {Eigen::VectorXd::Zero(f), 0.3 * direction};
  scene.prior.start = {0.03 * direction, Eigen::VectorXd::Zero(f)};
  scene.prior.uncertainty = Eigen::VectorXd::Constant(1, 0.2);
  ParameterUncertainty& parameters = scene.prior.parameters;
  parameters.keys = {"impact.restitution", "system.C", "system.K"};
  parameters.sigma.setConstant(3, share);
  parameters.sigma[0] *= model.contacts[0].restitution;
  parameters.correlation.setIdentity(3, 3);
  parameters.correlation(0, 1) = parameters.correlation(1, 0) = -0.5;
  parameters.consider.assign(3, false);
  return scene;
}

// The same machine under a record of a sweep with a second tone, with a sample every 10 ms. The
// record's delay is uncertain as well.
Scene swept_rattle(Random& random, Eigen::Index f, double share) {
  Scene scene = random_rattle(random, f, share);
  std::vector<double> t, a;
  for (int k = 0; k <= 2600; ++k) {
    t.push_back(0.01 * k);
    a.push_back(3.0 * std::sin(t.back() * (5.0 + 0.1 * t.back())) + std::sin(13.0 * t.back()));
  }
  scene.model.forces[0] = {
      scene.model.forces[0].direction,
      0.0,
      {},
      std::make_shared<const SampledInput>(t, a, SampledInput::Settings{.outside = Outside::hold})};
  ParameterUncertainty& parameters = scene.prior.parameters;
  parameters.keys.emplace_back("force.1.delay");
  parameters.sigma.conservativeResize(4);
  parameters.sigma[3] = share;  // [s]
  parameters.correlation.conservativeResizeLike(Eigen::MatrixXd::Identity(4, 4));
  parameters.consider.push_back(false);
  return scene;
}

// A machine whose damping couples the modes, with a single entry of K uncertain.
Scene coupled_rattle(Random& random, Eigen::Index, double share) {
  Scene scene = random_rattle(random, 2, share);
  scene.model.C(1, 1) += 0.4;
  scene.prior.parameters.keys[2] = "system.K.2.2";
  scene.prior.parameters.sigma[2] *= scene.model.K(1, 1);
  return scene;
}

// Two masses that a spring couples, each pressed against a stop of its own from which the
// excitation lifts it: often both are held.
Scene pressed_pair(Random& random, Eigen::Index, double share) {
  Scene scene = random_rattle(random, 2, share);
  Model& model = scene.model;
  model.M = random.uniform(0.8, 1.3) * Eigen::Matrix2d::Identity();
  model.C = 0.2 * model.M + 0.004 * model.K;
  Force& force = model.forces[0];
  force.direction = Eigen::Vector2d(1.0, random.uniform(0.6, 1.6));
  force.constant = -random.uniform(7.0, 8.0);
  force.harmonic.amplitude = random.uniform(11.0, 13.0);
  for (Eigen::Index i = 0; i < 2; ++i) {
    Contact& contact = model.contacts[static_cast<std::size_t>(i)];
    contact.w = Eigen::Vector2d::Unit(i);
    contact.restitution = 0.0;
  }
  ParameterUncertainty& parameters = scene.prior.parameters;
  parameters.keys = {"contact.2.clearance", "force.1.constant", "system.K"};
  parameters.sigma[0] = share * model.contacts[1].clearance;
  parameters.sigma[1] = share * std::abs(force.constant);
  return scene;
}

ParameterUncertainty uncertain_restitution(double sigma) {
  return {{"impact.restitution"},
          Eigen::VectorXd::Constant(1, sigma),
          Eigen::MatrixXd::Identity(1, 1),
          {false}};
}

// A machine drawn from the scene's [parameters].
struct Drawn {
  Scene machine;
  Eigen::VectorXd values;
  std::vector<ContactEvent> events;
  double h = 0.0;
  Eigen::MatrixXd q, u;  // f x ticks + 1
};

Drawn draw(const Scene& scene, Random& random, double duration) {
  Drawn drawn;
  const std::vector<Unknown> unknowns = unknowns_named(scene, scene.prior.parameters.keys);
  Eigen::VectorXd xi(scene.prior.parameters.size());
  for (double& x : xi) x = normal(random);
  drawn.values = nominal_values(unknowns) + scene.prior.parameters.root_of_covariance() * xi;
  drawn.machine = with(scene, unknowns, drawn.values);
  const Eigen::Index f = scene.model.coordinates();
  drawn.h = duration / static_cast<double>(ticks);
  drawn.q.setZero(f, ticks + 1);
  drawn.u.setZero(f, ticks + 1);
  Master master(drawn.machine.model, scene.truth.start);
  for (std::int64_t k = 0; k <= ticks; ++k) {
    master.advance(tick_instant(k, drawn.h), drawn.events);
    master.state(tick_instant(k, drawn.h), drawn.q.col(k), drawn.u.col(k));
  }
  // Each contact's reports stay in order.
  for (int contact = 0; contact < static_cast<int>(scene.model.contacts.size()); ++contact) {
    std::vector<double> times;
    for (ContactEvent& event : drawn.events) {
      if (event.contact == contact) {
        times.push_back(std::max(event.t + scene.prior.jitter * normal(random), 0.0));
      }
    }
    std::sort(times.begin(), times.end());
    std::size_t next = 0;
    for (ContactEvent& event : drawn.events) {
      if (event.contact == contact) event.t = times[next++];
    }
  }
  std::stable_sort(drawn.events.begin(), drawn.events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return drawn;
}

// Errors over claimed sigma, of ticks with a claim.
struct Claims {
  double squares = 0.0;
  std::int64_t count = 0, beyond_five = 0, samples = 0;
  std::vector<double> sigmas;

  double mean() const { return squares / static_cast<double>(count); }
  double share_beyond() const {
    return static_cast<double>(beyond_five) / static_cast<double>(count);
  }
  double median() {
    std::nth_element(sigmas.begin(), sigmas.begin() + std::ssize(sigmas) / 2, sigmas.end());
    return sigmas[sigmas.size() / 2];
  }
  void add(const Eigen::VectorXd& error, const Eigen::VectorXd& sigma) {
    for (Eigen::Index i = 0; i < error.size(); ++i) {
      ++samples;
      if (!std::isfinite(sigma[i])) continue;
      const double z = error[i] / std::hypot(sigma[i], 1e-13);
      squares += z * z;
      beyond_five += std::abs(z) > 5.0 ? 1 : 0;
      sigmas.push_back(sigma[i]);
      ++count;
    }
  }
};

// Runs the estimator through the ticks 1 to `last`; calls visit(k) after each.
template <typename Visit>
void run(TrackingEstimator& estimator, const Scene& scene, const Drawn& drawn, std::int64_t last,
         TrackingState& state, Visit visit) {
  estimator.start(scene.prior.start, 0, 0, state);
  std::size_t next = 0;
  for (std::int64_t k = 1; k <= last; ++k) {
    const std::size_t first = next;
    while (next < drawn.events.size() && drawn.events[next].t <= tick_instant(k, drawn.h).hi) {
      ++next;
    }
    estimator.tick(std::span(drawn.events).subspan(first, next - first), state);
    visit(k);
  }
}

struct Observed {
  Claims state, parameters;
  double sigma_restitution = 0.0;  // of the last run
};

void observe(const Scene& scene, const Drawn& drawn, Observed& observed) {
  TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
  TrackingState state;
  const Eigen::Index f = scene.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  Confidence confidence = estimator.no_confidence();
  run(estimator, scene, drawn, ticks, state, [&](std::int64_t k) {
    estimator.output(state, q, u);
    estimator.confidence(state, confidence);
    if (k < first_tick) return;
    observed.state.add(q - drawn.q.col(k), confidence.sigma_q);
    observed.state.add(u - drawn.u.col(k), confidence.sigma_u);
  });
  if (!confidence.parameters.any()) return;
  observed.sigma_restitution = confidence.parameters.sigmas[0];
  observed.parameters.add(confidence.parameters.values - drawn.values,
                          confidence.parameters.sigmas);
}

using DrawScene = Scene (*)(Random&, Eigen::Index, double);

// Holds the deviations of state and parameters against their errors on sixteen drawn machines.
// `finite`: least share of the ticks with a deviation.
void expect_calibrated(DrawScene draw_scene, std::uint64_t seed, double jitter, double finite) {
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Observed estimated, exact;
  for (int i = 0; i < 16; ++i) {
    Scene scene = draw_scene(random, 1 + i % 2, 1e-3);
    scene.prior.jitter = jitter;
    const Drawn drawn = draw(scene, random, 25.0);
    ASSERT_GT(drawn.events.size(), 30U);
    observe(scene, drawn, estimated);
    // Evidence that the trial can fail: parameters treated as exact.
    scene.prior.parameters = {};
    observe(scene, drawn, exact);
  }
  std::cout << "estimated: " << estimated.state.mean() << ", beyond 5 "
            << estimated.state.share_beyond() << ", finite " << estimated.state.count << " of "
            << estimated.state.samples << "; parameters " << estimated.parameters.mean()
            << "; taken as exact: " << exact.state.mean() << '\n';
  EXPECT_GT(estimated.state.mean(), 0.25);
  EXPECT_LT(estimated.state.mean(), 1.6);
  EXPECT_LT(estimated.state.share_beyond(), 1e-3);
  EXPECT_GT(static_cast<double>(estimated.state.count),
            finite * static_cast<double>(estimated.state.samples));
  EXPECT_GT(estimated.parameters.mean(), 0.4);
  EXPECT_LT(estimated.parameters.mean(), 1.8);
  EXPECT_TRUE(exact.state.count == 0 || exact.state.mean() > 4.0 * estimated.state.mean());
}

class UncertainParameters : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Jitters, UncertainParameters, ::testing::Values(1e-5, 1e-4, 1e-3));

TEST_P(UncertainParameters, SigmaMatchesErrorsOfEstimatedParameters) {
  expect_calibrated(random_rattle, 20, GetParam(), 0.95);
}

TEST_P(UncertainParameters, SigmaMatchesErrorsUnderARecord) {
  expect_calibrated(swept_rattle, 29, GetParam(), 0.9);
}

TEST_P(UncertainParameters, SigmaMatchesErrorsWithCoupledModes) {
  expect_calibrated(coupled_rattle, 31, GetParam(), 0.95);
}

TEST_P(UncertainParameters, SigmaMatchesErrorsWithSeveralContactsHeld) {
  expect_calibrated(pressed_pair, 32, GetParam(), 0.9);
}

TEST_P(UncertainParameters, SigmaMatchesErrorsWithConsideredParameters) {
  constexpr std::uint64_t seed = 21;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Observed observed;
  for (int i = 0; i < 12; ++i) {
    Scene scene = random_rattle(random, 1 + i % 2, 1e-3);
    scene.prior.jitter = GetParam();
    scene.prior.parameters.consider.assign(3, true);
    const Drawn drawn = draw(scene, random, 25.0);
    Observed one;
    observe(scene, drawn, one);
    EXPECT_NEAR(one.sigma_restitution, scene.prior.parameters.sigma[0], 1e-9);
    observe(scene, drawn, observed);
  }
  std::cout << "considered: " << observed.state.mean() << '\n';
  EXPECT_GT(observed.state.mean(), 0.25);
  EXPECT_LT(observed.state.mean(), 1.6);
  EXPECT_LT(observed.state.share_beyond(), 1e-3);
}

TEST_P(UncertainParameters, SmoothingReducesSigmaAndIsCalibrated) {
  constexpr std::uint64_t seed = 22;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Claims smoothed;
  Observed filtered;
  for (int i = 0; i < 8; ++i) {
    Scene scene = random_rattle(random, 1 + i % 2, 1e-3);
    scene.prior.jitter = GetParam();
    const Drawn drawn = draw(scene, random, 25.0);
    observe(scene, drawn, filtered);
    std::int64_t of_all = 0;
    smooth(scene, drawn.events, drawn.h, ticks,
           [&](std::int64_t k, const SmoothedEstimate& estimate, bool is_smoothed) {
             of_all += is_smoothed ? 1 : 0;
             if (k < first_tick) return;
             smoothed.add(estimate.q - drawn.q.col(k), estimate.sigma_q);
             smoothed.add(estimate.u - drawn.u.col(k), estimate.sigma_u);
           });
    EXPECT_GT(of_all, ticks * 9 / 10);
  }
  std::cout << "smoothed: " << smoothed.mean() << ", beyond 5 " << smoothed.share_beyond()
            << ", median sigma " << smoothed.median() << " of the filter's "
            << filtered.state.median() << '\n';
  EXPECT_GT(smoothed.mean(), 0.25);
  EXPECT_LT(smoothed.mean(), 1.6);
  EXPECT_LT(smoothed.share_beyond(), 2e-3);
  EXPECT_LT(smoothed.median(), 0.9 * filtered.state.median());
}

// Grazing impacts, bursts and sustained contacts: smoothing converges there, too.
TEST(UncertainParametersOf, SmoothedChatter) {
  constexpr std::uint64_t seed = 28;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Claims smoothed;
  for (int i = 0; i < 12; ++i) {
    Scene scene = shipped_scene("paper_beam_chatter");
    scene.prior.jitter = 1e-3;
    scene.prior.parameters = uncertain_restitution(1e-3 * scene.model.contacts[0].restitution);
    const Drawn drawn = draw(scene, random, 40.0);
    std::int64_t of_all = 0;
    smooth(scene, drawn.events, drawn.h, ticks,
           [&](std::int64_t k, const SmoothedEstimate& estimate, bool is_smoothed) {
             of_all += is_smoothed ? 1 : 0;
             if (k < first_tick) return;
             smoothed.add(estimate.q - drawn.q.col(k), estimate.sigma_q);
             smoothed.add(estimate.u - drawn.u.col(k), estimate.sigma_u);
           });
    EXPECT_GT(of_all, ticks * 8 / 10) << i;
  }
  std::cout << "smoothed: " << smoothed.mean() << ", beyond 5 " << smoothed.share_beyond() << '\n';
  EXPECT_GT(smoothed.mean(), 0.25);
  EXPECT_LT(smoothed.mean(), 1.6);
  EXPECT_LT(smoothed.share_beyond(), 2e-3);
}

// Late reports: the time line rolls back and settles the same estimates.
TEST(UncertainParametersLive, EqualTheReplayBitForBit) {
  constexpr std::uint64_t seed = 24;
  Random random(seed);
  Scene scene = random_rattle(random, 2, 1e-3);
  scene.prior.jitter = 1e-4;
  const Drawn drawn = draw(scene, random, 25.0);
  const auto settled = [&](std::int64_t delay) {
    TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
    TimeLine line(estimator, 2, scene.prior.start, 16);
    line.restart(0, 0, 0, no_horizon);
    std::vector<double> rows;
    Eigen::VectorXd q(2), u(2);
    Confidence confidence = estimator.no_confidence();
    std::size_t next = 0;
    for (std::int64_t k = 0; k <= ticks; k += 5) {
      const double t = tick_instant(k, drawn.h).hi;
      while (next < drawn.events.size() && drawn.events[next].t <= t) {
        line.receive(drawn.events[next++]);
      }
      line.set_horizon(t);
      line.run(
          k + delay, [](const auto&) {},
          [&](const TrackingState& state) {
            estimator.output(state, q, u);
            estimator.confidence(state, confidence);
            for (const Eigen::VectorXd* x :
                 {&std::as_const(q), &std::as_const(u), &std::as_const(confidence.sigma_q),
                  &std::as_const(confidence.parameters.values)}) {
              rows.insert(rows.end(), x->begin(), x->end());
            }
            return true;
          });
    }
    EXPECT_EQ(line.rollbacks().rollbacks > 10, delay > 0);
    return rows;
  };
  const std::vector<double> replayed = settled(0);
  EXPECT_GT(replayed.size(), 5000U);
  EXPECT_EQ(settled(8), replayed);
  EXPECT_EQ(settled(40), replayed);  // a rollback beyond the history
}

// The library's observer uses the uncertainty.
TEST(UncertainParametersOf, TheLibrarysObserver) {
  Random random(25);
  Scene scene = random_rattle(random, 1, 1e-3);
  scene.prior.jitter = 1e-4;
  const Drawn drawn = draw(scene, random, 10.0);
  const ObserverSettings settings{drawn.h, EstimatorKind::both};
  const Estimates estimates = observe(scene, drawn.events, 10.0, settings);
  ASSERT_EQ(estimates.keys, scene.prior.parameters.keys);
  EXPECT_LT(estimates.sigma_parameters.bottomRows(1)(0, 0), 0.7 * scene.prior.parameters.sigma[0]);
  EXPECT_TRUE(estimates.sigma_q.allFinite());
}

// Impact records claim sigma of the time of an impact and of its velocities.
TEST(UncertainParametersOf, ImpactRecords) {
  constexpr std::uint64_t seed = 27;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Claims times, velocities;
  for (int i = 0; i < 8; ++i) {
    Scene scene = random_rattle(random, 1, 1e-3);
    scene.prior.jitter = 1e-4;
    const Drawn drawn = draw(scene, random, 25.0);
    Master master(drawn.machine.model, scene.truth.start);
    std::vector<ContactEvent> exact;
    master.advance(at(25.0), exact);
    TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
    std::vector<ImpactRecord> records;
    estimator.record_in(records);
    TrackingState state;
    run(estimator, scene, drawn, ticks, state, [](std::int64_t) {});
    Eigen::VectorXd q(1), u(1);
    Master again(drawn.machine.model, scene.truth.start);
    std::vector<ContactEvent> passed;
    for (std::size_t k = 0; k < std::min(records.size(), exact.size()); ++k) {
      if (records[k].contact != exact[k].contact || exact[k].kind != ContactEventKind::pulse) break;
      again.advance(at(exact[k].t), passed);
      again.state(at(exact[k].t), q, u);
      if (k < 8) continue;
      ASSERT_TRUE(records[k].from_filter);
      const auto claim = [](double error, double sigma, Claims& claims) {
        claims.add(Eigen::VectorXd::Constant(1, error), Eigen::VectorXd::Constant(1, sigma));
      };
      claim(records[k].time.value - exact[k].t, records[k].time.sigma, times);
      const Contact& contact = drawn.machine.model.contacts[index(exact[k].contact)];
      claim(records[k].after.value - gap_velocity(contact, u, exact[k].t), records[k].after.sigma,
            velocities);
    }
  }
  std::cout << times.count << " impacts, times " << times.mean() << ", velocities "
            << velocities.mean() << '\n';
  EXPECT_GT(times.count, 100);
  EXPECT_GT(times.mean(), 0.3);
  EXPECT_LT(times.mean(), 1.8);
  EXPECT_LT(times.median(), 0.5e-4);  // less than the jitter
  EXPECT_GT(velocities.mean(), 0.2);
  EXPECT_LT(velocities.mean(), 2.0);
}

// The differences between events and their predictions match the claimed sigma.
TEST(UncertainParametersOf, Predictions) {
  constexpr std::uint64_t seed = 26;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Claims claims;
  for (int i = 0; i < 12; ++i) {
    Scene scene = random_rattle(random, 1, 1e-2);
    scene.prior.jitter = 1e-4;
    const Drawn drawn = draw(scene, random, 12.0);
    std::vector<ContactEvent> true_events;
    Master(drawn.machine.model, scene.truth.start).advance(at(20.0), true_events);
    TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
    const Predictor predictor(scene.model);
    TrackingState state;
    run(estimator, scene, drawn, 600, state, [&](std::int64_t k) {
      if (k % 100 != 0) return;
      const double t = tick_instant(k, drawn.h).hi;
      const Prediction prediction = estimator.predict(state, predictor, 2.0);
      std::size_t j = 0;
      while (j < true_events.size() && true_events[j].t <= t) ++j;
      for (const PredictedEvent& event : prediction.events) {
        ASSERT_LT(j, true_events.size());
        claims.add(Eigen::VectorXd::Constant(1, event.t - true_events[j].t),
                   Eigen::VectorXd::Constant(1, event.sigma));
        ++j;
      }
    });
  }
  std::cout << claims.count << " predicted, " << claims.mean() << '\n';
  EXPECT_GT(claims.count, 60);
  EXPECT_GT(claims.mean(), 0.3);
  EXPECT_LT(claims.mean(), 1.8);
}

TEST(UncertainParametersOf, TheClockIsRefused) {
  Scene scene = shipped_scene("paper_beam");
  scene.prior.parameters = uncertain_restitution(1e-3);
  scene.prior.parameters.keys[0] = "clock.rate";
  EXPECT_THROW(TrackingEstimator(scene, 0.01, EstimatorKind::both), ModelError);
  EXPECT_NO_THROW(TrackingEstimator(scene, 0.01, EstimatorKind::replica));
}

}  // namespace
}  // namespace sprag
