// Gain and delay of a recorded input as unknowns, on machines of one and two coordinates between
// two stops. The truth moves under a finely sampled smooth signal, the fit knows coarser samples.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>
#include <random>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/identification.h"
#include "tests/identification/fitted_unknown.h"
#include "tests/support/random.h"
#include "tests/support/rattle.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

// A sweep with a second tone.
double signal(double t) {
  return 3.0 * std::sin(t * (5.0 + 0.1 * t)) + 1.2 * std::sin(13.0 * t + 0.4);
}

SampledInputPointer sampled(double dt, double end, SampledInput::Settings settings,
                            double noise = 0.0, std::mt19937_64* engine = nullptr) {
  std::vector<double> t, values;
  std::normal_distribution<double> normal;
  for (int k = 0; k <= static_cast<int>(end / dt); ++k) {
    t.push_back(dt * k);
    values.push_back(signal(t.back()) + (engine != nullptr ? noise * normal(*engine) : 0.0));
  }
  return std::make_shared<const SampledInput>(t, values, std::move(settings));
}

constexpr double recorded = 20.0;  // duration

Scene shaken_rattle(Random& random, Eigen::Index f, bool coupled = false) {
  Scene scene = test::rattle(random, f, coupled);
  scene.model.forces.push_back(
      {test::across(f),
       0.0,
       {},
       sampled(1e-3, recorded + 1.0,
               {.interpolation = Interpolation::spline, .outside = Outside::hold})});
  return scene;
}

std::vector<ContactEvent> events_of(const Scene& machine, double jitter, std::uint64_t seed) {
  std::vector<ContactEvent> events = test::events_of(machine, recorded);
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  for (ContactEvent& event : events) event.t += jitter * normal(engine);
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return events;
}

Scene with_input(const Scene& scene, const SampledInput& input) {
  Scene changed = scene;
  changed.model.forces[0].input = std::make_shared<const SampledInput>(input);
  return changed;
}

// Errors of determined values in their deviations, and without the part that the record adds.
struct Errors {
  double squares = 0.0, without_record = 0.0;
  int values = 0;

  void add(const FittedUnknown& of, double truth) {
    if (!of.determined) return;
    const double error = of.value - truth;
    EXPECT_LT(std::abs(error), 4.0 * of.sigma) << of.unknown.key;
    squares += error * error / (of.sigma * of.sigma);
    without_record += error * error / (of.sigma * of.sigma - of.of_record * of.of_record);
    ++values;
  }
};

TEST(RecordedIdentification, FindsGainAndDelay) {
  constexpr std::uint64_t seed = 71;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  constexpr double dt = 0.01;
  for (int i = 0; i < 4; ++i) {
    const Scene truth = shaken_rattle(random, 1 + i % 2, i == 3);
    const auto events = events_of(truth, 0.0, seed);
    // The record has another gain, and its times lack half a sample.
    const double gain = 1.15, delay = 0.5 * dt;
    std::vector<double> t, values;
    for (double at = 0.0; at < recorded + 1.0; at += dt) {
      t.push_back(at - delay);
      values.push_back(signal(at) / gain);
    }
    const Scene given = with_input(
        truth, {t, values, {.interpolation = Interpolation::spline, .outside = Outside::hold}});
    IdentificationSettings settings;
    settings.unknowns = parameters_named(given, {"force.1.gain", "force.1.delay"});
    settings.jitter = 1e-5;
    const Identification fit = identify(given, events, settings);
    ASSERT_TRUE(fit.fits()) << static_cast<int>(fit.problem) << " scatter " << fit.scatter;
    EXPECT_NEAR(fitted(fit, "force.1.gain").value, gain, 0.01 * gain);
    EXPECT_NEAR(fitted(fit, "force.1.delay").value, delay, 0.05 * delay);
  }
}

// A fit absorbs the error between samples in its unknowns: without the deviation by the record it
// would claim thousands of its errors.
class InterpolationError : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(TruthIsLinear, InterpolationError, ::testing::Bool());

TEST_P(InterpolationError, IsPartOfTheDeviations) {
  const bool truth_is_linear = GetParam();
  constexpr std::uint64_t seed = 72;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  Errors errors;
  for (int i = 0; i < (thorough() ? 8 : 4); ++i) {
    Scene truth = shaken_rattle(random, 1 + i % 2);
    const SampledInputPointer linear = sampled(0.01, recorded + 1.0, {.outside = Outside::hold});
    SampledInput::Settings settings_of_spline = linear->settings();
    settings_of_spline.interpolation = Interpolation::spline;
    Scene given = with_input(truth, *linear);
    if (truth_is_linear) {
      given =
          with_input(truth, {linear->sample_times(), linear->sample_values(), settings_of_spline});
      truth = with_input(truth, *linear);
    }
    IdentificationSettings settings;
    settings.unknowns =
        parameters_named(given, {"impact.restitution", "system.C", "system.K", "force.1.delay"});
    for (Parameter& unknown : settings.unknowns) unknown.within = 0.1;
    settings.mend = false;
    const Identification fit = identify(given, events_of(truth, 0.0, seed), settings);
    if (!fit.fits()) continue;
    for (const FittedUnknown& of : fit.unknowns) errors.add(of, of.unknown.nominal);
  }
  std::cout << "NEES " << errors.squares / errors.values << ", without the record "
            << errors.without_record / errors.values << " of " << errors.values << '\n';
  EXPECT_GE(errors.values, 8);
  EXPECT_LT(errors.squares, 2.0 * errors.values);
  // Evidence that the trial can fail.
  EXPECT_GT(errors.without_record, 4.0 * errors.values);
}

class SampleNoise : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Shares, SampleNoise, ::testing::Values(0.003, 0.03));

TEST_P(SampleNoise, IsPartOfTheDeviations) {
  constexpr std::uint64_t seed = 73;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  std::mt19937_64 engine(seed);
  const double noise = GetParam();
  Errors errors;
  for (int i = 0; i < 8; ++i) {
    const Scene truth = shaken_rattle(random, 1 + i % 2);
    const Scene given = with_input(
        truth,
        *sampled(0.01, recorded + 1.0,
                 {.interpolation = Interpolation::spline, .outside = Outside::hold, .noise = noise},
                 noise, &engine));
    IdentificationSettings settings;
    settings.unknowns =
        parameters_named(given, {"impact.restitution", "force.1.gain", "force.1.delay"});
    settings.jitter = 1e-5;
    settings.mend = false;
    const Identification fit = identify(given, events_of(truth, 1e-5, seed), settings);
    if (!fit.fits()) continue;
    for (const FittedUnknown& of : fit.unknowns) {
      errors.add(of, of.unknown.key == "force.1.delay" ? 0.0 : of.unknown.nominal);
    }
  }
  std::cout << "NEES " << errors.squares / errors.values << " of " << errors.values << '\n';
  EXPECT_GT(errors.values, 20);
  EXPECT_LT(errors.squares, 2.0 * errors.values);
  EXPECT_GT(errors.squares, 0.2 * errors.values);
}

// A given jitter does not hide that the record is too coarse.
TEST(RecordedIdentification, CoarseRecordIsNamedAsTheReason) {
  constexpr std::uint64_t seed = 74;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  const Scene truth = shaken_rattle(random, 1);
  const Scene given = with_input(truth, *sampled(0.02, recorded + 1.0, {.outside = Outside::hold}));
  const auto events = events_of(truth, 1e-7, seed);
  IdentificationSettings settings;
  settings.unknowns = parameters_named(given, {"impact.restitution"});
  settings.jitter = 1e-7;
  settings.mend = false;
  const Identification fit = identify(given, events, settings);
  ASSERT_EQ(fit.problem, FitProblem::wrong_model);
  EXPECT_TRUE(fit.record_errors.explains(fit.scatter));
  EXPECT_NE(reason_of(fit).find("recorded input"), std::string::npos) << reason_of(fit);
  // Within a jitter that covers the scatter, the record limits the value.
  settings.jitter = 2.0 * fit.scatter;
  const Identification wide = identify(given, events, settings);
  ASSERT_TRUE(wide.fits());
  const FittedUnknown& epsilon = wide.unknowns.front();
  EXPECT_GT(epsilon.of_record, 0.0);
  EXPECT_LT(std::abs(epsilon.value - 0.7), 4.0 * epsilon.sigma);
}

// A frame whose displacement was recorded moves supports on the ground.
TEST(RecordedIdentification, FindsTheDelayOfADisplacement) {
  constexpr std::uint64_t seed = 75;
  std::cout << "seed " << seed << '\n';
  constexpr double dt = 0.002, delay = 0.5 * dt;
  const auto e = [](double t) {
    return 0.004 * std::sin(11.0 * t) + 0.002 * std::sin(t * (17.0 + 0.3 * t));
  };
  const auto record = [&](double every, double shift) {
    std::vector<double> t, values;
    for (int k = -5; every * k < recorded + 1.0; ++k) {
      t.push_back(every * k - shift);
      values.push_back(e(every * k));
    }
    return SampledInput(t, values, {.interpolation = Interpolation::spline, .displacement = true});
  };
  Random random(seed);
  for (const Eigen::Index f : {1, 2}) {
    Scene scene = shaken_rattle(random, f);
    scene.model.forces.clear();
    scene.frame.emplace();
    scene.frame->influence = Eigen::VectorXd::Ones(f);
    const auto with_record = [&](const SampledInput& input) {
      Scene changed = scene;
      const auto shared = std::make_shared<const SampledInput>(input);
      changed.frame->input = shared;
      changed.model.forces.push_back(frame_force(changed.model.M, *changed.frame));
      for (int i = 0; i < 2; ++i) {
        Contact& contact = changed.model.contacts[static_cast<std::size_t>(i)];
        contact.clearance = 0.01;
        contact.input = shared;
        contact.input_share = contact.w.dot(changed.frame->influence);
        changed.frame->on_ground.push_back(i);
      }
      return changed;
    };
    const auto events = events_of(with_record(record(2e-4, 0.0)), 0.0, seed);
    const Scene given = with_record(record(dt, delay));
    IdentificationSettings settings;
    settings.unknowns =
        parameters_named(given, {"excitation.delay", "excitation.gain", "impact.restitution"});
    settings.jitter = 1e-5;
    const Identification fit = identify(given, events, settings);
    ASSERT_TRUE(fit.fits()) << static_cast<int>(fit.problem) << ", scatter " << fit.scatter;
    EXPECT_NEAR(fit.unknowns[0].value, delay, 0.05 * delay);
    EXPECT_NEAR(fit.unknowns[1].value, 1.0, 1e-3);
    EXPECT_EQ(fit.fitted.frame->input, fit.fitted.model.forces[0].input);
    EXPECT_EQ(fit.fitted.model.contacts[1].input, fit.fitted.model.forces[0].input);
    EXPECT_EQ(fit.fitted.frame->input->settings().delay, fit.unknowns[0].value);
  }
}

TEST(RecordedIdentification, KeysAndScale) {
  Random random(76);
  const Scene scene = shaken_rattle(random, 1);
  // The gain sets the scale, unless a clearance is known.
  const auto has = [](const std::vector<Parameter>& unknowns, const std::string& key) {
    return std::any_of(unknowns.begin(), unknowns.end(),
                       [&](const Parameter& unknown) { return unknown.key == key; });
  };
  EXPECT_FALSE(has(all_but_the_scale(scene), "force.1.gain"));
  EXPECT_TRUE(has(all_but_the_scale(scene), "force.1.delay"));
  EXPECT_TRUE(has(all_but_the_scale(scene, {"contact.1.clearance"}), "force.1.gain"));
}

}  // namespace
}  // namespace sprag
