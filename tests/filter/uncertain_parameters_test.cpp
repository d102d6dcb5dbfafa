// Claimed sigma against true errors with uncertain parameters and noisy records: machines with
// parameters drawn from the scene's [parameters], and jittered event times.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/smoother.h"
#include "tests/support/claims.h"
#include "tests/support/rattle.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using test::Claims;

constexpr std::int64_t ticks = 800;
constexpr std::int64_t first_tick = 120;  // the start no longer matters

// Machine after machine takes the next of these jitters; a thorough run has more machines.
constexpr std::array jitters{1e-5, 1e-4, 1e-3};
double jitter_of(int machine) { return jitters.at(static_cast<std::size_t>(machine) % 3); }
int coordinates_of(int machine) { return 1 + machine / 3 % 2; }
int machines(int usual) { return thorough() ? 3 * usual : repetitions(usual); }

SampledInputPointer record_of(const std::vector<double>& t, const std::vector<double>& a,
                              const SampledInput::Settings& settings) {
  return std::make_shared<const SampledInput>(t, a, settings);
}

// A driven machine of `f` coordinates between two stops.
Scene random_rattle(Random& random, Eigen::Index f, double share) {
  Scene scene = test::rattle(random, f);
  Model& model = scene.model;
  model.forces.push_back(
      {test::across(f), 0.0, {random.uniform(2.5, 3.5), random.uniform(6.0, 8.0), 0.0}});
  model.contacts[0].restitution = model.contacts[1].restitution = random.uniform(0.6, 0.8);
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
  scene.model.forces[0].harmonic = {};
  scene.model.forces[0].input = record_of(t, a, {.outside = Outside::hold});
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

// The same with a mass, and the direction in which a contact sees the masses, uncertain.
Scene weighed_rattle(Random& random, Eigen::Index, double share) {
  Scene scene = random_rattle(random, 2, share);
  ParameterUncertainty& parameters = scene.prior.parameters;
  parameters.keys = {"impact.restitution", "contact.1.direction.1", "system.M.2.2"};
  parameters.sigma[1] *= std::abs(scene.model.contacts[0].w[0]);
  parameters.sigma[2] *= scene.model.M(1, 1);
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

// A machine drawn from the scene's [parameters], its jittered events and its states at the ticks.
struct Drawn {
  Scene machine;
  Eigen::VectorXd values;
  std::vector<ContactEvent> events;
  double h = 0.0;
  Eigen::MatrixXd q, u;  // f x ticks + 1
};

Drawn draw(const Scene& scene, Random& random, double duration) {
  Drawn drawn;
  const std::vector<Parameter> unknowns = parameters_named(scene, scene.prior.parameters.keys);
  Eigen::VectorXd xi(scene.prior.parameters.size());
  for (double& x : xi) x = random.normal();
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
        times.push_back(std::max(event.t + scene.prior.jitter * random.normal(), 0.0));
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
    if (k < first_tick) return;
    estimator.output(state, q, u);
    estimator.confidence(state, confidence);
    observed.state.add(q - drawn.q.col(k), confidence.sigma_q);
    observed.state.add(u - drawn.u.col(k), confidence.sigma_u);
  });
  if (!confidence.parameters.any()) return;
  observed.sigma_restitution = confidence.parameters.sigmas[0];
  observed.parameters.add(confidence.parameters.values - drawn.values,
                          confidence.parameters.sigmas);
}

// Adds the smoothed path; `least`: share of ticks that must be smoothed.
void smooth(const Scene& scene, const Drawn& drawn, double least, Claims& smoothed) {
  std::int64_t of_all = 0;
  sprag::smooth(scene, drawn.events, drawn.h, ticks,
                [&](std::int64_t k, const SmoothedEstimate& estimate, bool is_smoothed) {
                  of_all += is_smoothed ? 1 : 0;
                  if (k < first_tick) return;
                  smoothed.add(estimate.q - drawn.q.col(k), estimate.sigma_q);
                  smoothed.add(estimate.u - drawn.u.col(k), estimate.sigma_u);
                });
  EXPECT_GT(static_cast<double>(of_all), least * ticks);
}

void expect_calibrated(const Claims& claims, double beyond) {
  std::cout << "mean z^2 " << claims.mean() << ", beyond 5 sigma " << claims.share_beyond()
            << ", claimed " << claims.share_claimed() << '\n';
  EXPECT_LT(claims.share_beyond(), beyond);
  if (sanitized) return;  // too few machines for a mean
  EXPECT_GT(claims.mean(), 0.25);
  EXPECT_LT(claims.mean(), 1.6);
}

struct UncertainMachine {
  const char* name;
  Scene (*draw)(Random&, Eigen::Index, double);
  std::uint64_t seed;
  double claimed;  // least share of the ticks with a deviation
};
void PrintTo(const UncertainMachine& kind, std::ostream* out) { *out << kind.name; }

class UncertainParameters : public ::testing::TestWithParam<UncertainMachine> {};
INSTANTIATE_TEST_SUITE_P(Kinds, UncertainParameters,
                         ::testing::Values(UncertainMachine{"rattle", random_rattle, 20, 0.95},
                                           UncertainMachine{"record", swept_rattle, 29, 0.9},
                                           UncertainMachine{"coupled", coupled_rattle, 31, 0.95},
                                           UncertainMachine{"weighed", weighed_rattle, 33, 0.95},
                                           UncertainMachine{"pressed", pressed_pair, 32, 0.9}),
                         [](const auto& of) { return std::string(of.param.name); });

TEST_P(UncertainParameters, SigmaMatchesErrorsOfEstimatedParameters) {
  std::cout << "seed " << GetParam().seed << '\n';
  Random random(GetParam().seed);
  Observed estimated, exact;
  for (int i = 0; i < machines(18); ++i) {
    Scene scene = GetParam().draw(random, coordinates_of(i), 1e-3);
    scene.prior.jitter = jitter_of(i);
    const Drawn drawn = draw(scene, random, 25.0);
    ASSERT_GT(drawn.events.size(), 30U);
    observe(scene, drawn, estimated);
    if (i >= 6) continue;
    // Evidence that the trial can fail: parameters treated as exact.
    scene.prior.parameters = {};
    observe(scene, drawn, exact);
  }
  expect_calibrated(estimated.state, 1e-3);
  std::cout << "parameters " << estimated.parameters.mean() << "; taken as exact "
            << exact.state.mean() << '\n';
  EXPECT_GT(estimated.state.share_claimed(), GetParam().claimed);
  if (sanitized) return;
  EXPECT_GT(estimated.parameters.mean(), 0.4);
  EXPECT_LT(estimated.parameters.mean(), 1.8);
  EXPECT_TRUE(exact.state.count == 0 || exact.state.mean() > 4.0 * estimated.state.mean());
}

TEST(UncertainParametersOf, ConsideredParametersKeepTheirSigma) {
  Random random(21);
  Observed observed;
  for (int i = 0; i < machines(12); ++i) {
    Scene scene = random_rattle(random, coordinates_of(i), 1e-3);
    scene.prior.jitter = jitter_of(i);
    scene.prior.parameters.consider.assign(3, true);
    observe(scene, draw(scene, random, 25.0), observed);
    EXPECT_NEAR(observed.sigma_restitution, scene.prior.parameters.sigma[0], 1e-9);
  }
  expect_calibrated(observed.state, 1e-3);
}

TEST(UncertainParametersOf, SmoothingReducesSigma) {
  Random random(22);
  Claims smoothed;
  Observed filtered;
  for (int i = 0; i < machines(9); ++i) {
    Scene scene = random_rattle(random, coordinates_of(i), 1e-3);
    scene.prior.jitter = jitter_of(i);
    const Drawn drawn = draw(scene, random, 25.0);
    observe(scene, drawn, filtered);
    smooth(scene, drawn, 0.9, smoothed);
  }
  expect_calibrated(smoothed, 2e-3);
  EXPECT_LT(smoothed.median(), 0.9 * filtered.state.median());
}

// Grazing impacts, bursts and sustained contacts: smoothing converges there, too.
TEST(UncertainParametersOf, SmoothedChatter) {
  Random random(28);
  Claims smoothed;
  for (int i = 0; i < machines(6); ++i) {
    Scene scene = cached_scene("paper_beam_chatter.toml");
    scene.prior.jitter = 1e-3;
    scene.prior.parameters = uncertain_restitution(1e-3 * scene.model.contacts[0].restitution);
    smooth(scene, draw(scene, random, 40.0), 0.8, smoothed);
  }
  expect_calibrated(smoothed, 2e-3);
}

// The machine moves under a clean record, the observer knows one with noise: a share of the rms.
class NoisyRecord : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Shares, NoisyRecord, ::testing::Values(0.001, 0.01, 0.05));

TEST_P(NoisyRecord, SigmaMatchesErrors) {
  Random random(51);
  Observed stated, ignored;
  for (int i = 0; i < machines(9); ++i) {
    Scene scene = test::rattle(random, 1 + i % 2);
    scene.prior.uncertainty = Eigen::VectorXd::Constant(1, 0.2);
    scene.prior.jitter = 1e-5;
    std::vector<double> t, clean, noisy;
    double squares = 0.0;
    for (int k = 0; k <= 4200; ++k) {
      t.push_back(0.005 * k);
      clean.push_back(3.0 * std::sin(t.back() * (5.0 + 0.1 * t.back())));
      squares += square(clean.back());
    }
    const double noise = GetParam() * std::sqrt(squares / static_cast<double>(clean.size()));
    for (const double a : clean) noisy.push_back(a + noise * random.normal());
    scene.model.forces.push_back(
        {test::across(scene.model.coordinates()), 0.0, {}, record_of(t, clean, {})});
    const Drawn drawn = draw(scene, random, 20.0);
    scene.model.forces[0].input = record_of(t, noisy, {.noise = noise});
    observe(scene, drawn, stated);
    if (i >= 4) continue;
    // Evidence that the trial can fail: the filter is falsely certain, or its innovations fail
    // their gates and it claims nothing.
    scene.model.forces[0].input = record_of(t, noisy, {});
    observe(scene, drawn, ignored);
  }
  std::cout << "noise " << GetParam() << " of rms: z^2 " << stated.state.mean() << ", not stated "
            << ignored.state.mean() << " of " << ignored.state.count << '\n';
  EXPECT_GT(stated.state.share_claimed(), 0.5);
  EXPECT_GT(stated.state.mean(), 0.5);
  EXPECT_LT(stated.state.mean(), 1.5);
  EXPECT_TRUE(ignored.state.share_claimed() < 0.1 || ignored.state.mean() > 4.0);
}

// Late reports: the time line rolls back and settles the same estimates.
TEST(UncertainParametersOf, LateReportsChangeNothing) {
  Random random(24);
  Scene scene = random_rattle(random, 2, 1e-3);
  scene.prior.jitter = 1e-4;
  const Drawn drawn = draw(scene, random, 25.0);
  const auto settled = [&](bool late) {
    TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
    Confidence confidence = estimator.no_confidence();
    Eigen::VectorXd q(2), u(2);
    std::vector<double> rows;
    run_time_line(estimator, scene, drawn.events, 25.0, late, [&](const TrackingState& state) {
      estimator.output(state, q, u);
      estimator.confidence(state, confidence);
      for (const Eigen::VectorXd* x :
           {&std::as_const(q), &std::as_const(u), &std::as_const(confidence.sigma_q),
            &std::as_const(confidence.parameters.values)}) {
        rows.insert(rows.end(), x->begin(), x->end());
      }
    });
    return rows;
  };
  const std::vector<double> at_once = settled(false);
  EXPECT_GT(at_once.size(), 5000U);
  EXPECT_EQ(settled(true), at_once);
}

// Impact records claim sigma of the time of an impact and of its velocities.
TEST(UncertainParametersOf, ImpactRecords) {
  Random random(27);
  Claims times, velocities;
  for (int i = 0; i < 8; ++i) {
    Scene scene = random_rattle(random, 1, 1e-3);
    scene.prior.jitter = 1e-4;
    const Drawn drawn = draw(scene, random, 25.0);
    const std::vector<ContactEvent> exact = master_events(drawn.machine, 25.0);
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
      times.add(records[k].time.value - exact[k].t, records[k].time.sigma);
      const Contact& contact = drawn.machine.model.contacts[index(exact[k].contact)];
      velocities.add(records[k].after.value - gap_velocity(contact, u, exact[k].t),
                     records[k].after.sigma);
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
  Random random(26);
  Claims claims;
  for (int i = 0; i < 12; ++i) {
    Scene scene = random_rattle(random, 1, 1e-2);
    scene.prior.jitter = 1e-4;
    const Drawn drawn = draw(scene, random, 12.0);
    const std::vector<ContactEvent> true_events = master_events(drawn.machine, 20.0);
    TrackingEstimator estimator(scene, drawn.h, EstimatorKind::both);
    const Predictor predictor(scene.model);
    TrackingState state;
    run(estimator, scene, drawn, 600, state, [&](std::int64_t k) {
      if (k % 100 != 0) return;
      const double t = tick_instant(k, drawn.h).hi;
      std::size_t j = 0;
      while (j < true_events.size() && true_events[j].t <= t) ++j;
      for (const PredictedEvent& event : estimator.predict(state, predictor, 2.0).events) {
        ASSERT_LT(j, true_events.size());
        claims.add(event.t - true_events[j++].t, event.sigma);
      }
    });
  }
  std::cout << claims.count << " predicted, " << claims.mean() << '\n';
  EXPECT_GT(claims.count, 60);
  EXPECT_GT(claims.mean(), 0.3);
  EXPECT_LT(claims.mean(), 1.8);
}

TEST(UncertainParametersOf, TheClockIsRefused) {
  Scene scene = cached_scene("paper_beam.toml");
  scene.prior.parameters = uncertain_restitution(1e-3);
  scene.prior.parameters.keys[0] = "clock.rate";
  EXPECT_THROW(TrackingEstimator(scene, 0.01, EstimatorKind::both), ModelError);
  EXPECT_NO_THROW(TrackingEstimator(scene, 0.01, EstimatorKind::replica));
}

}  // namespace
}  // namespace sprag
