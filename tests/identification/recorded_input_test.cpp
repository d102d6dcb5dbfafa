// Gain and delay of a recorded input as unknowns, on machines of one and two coordinates between
// two stops. The truth moves under a finely sampled smooth signal, the fit knows coarser samples.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>
#include <random>

#include "sprag/detail/identification/free_flight.h"
#include "sprag/detail/identification/recorded_response.h"
#include "sprag/identification.h"
#include "tests/support/random.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

// A sweep with a second tone.
double signal(double t) {
  return 3.0 * std::sin(t * (5.0 + 0.1 * t)) + 1.2 * std::sin(13.0 * t + 0.4);
}

SampledInputPointer sampled(double dt, double duration, SampledInput::Settings settings,
                            double noise = 0.0, std::mt19937_64* engine = nullptr) {
  std::vector<double> t, values;
  std::normal_distribution<double> normal;
  for (int k = 0; k <= static_cast<int>(duration / dt); ++k) {
    t.push_back(dt * k);
    values.push_back(signal(t.back()) + (engine != nullptr ? noise * normal(*engine) : 0.0));
  }
  return std::make_shared<const SampledInput>(t, values, std::move(settings));
}

constexpr double duration = 20.0;

Scene rattle(Random& random, Eigen::Index f, bool coupled = false) {
  Scene scene;
  Model& model = scene.model;
  model.M = random.positive_definite(f, 0.8, 1.3);
  model.K = random.positive_definite(f, 15.0, 60.0);
  model.C = coupled ? random.positive_definite(f, 0.1, 0.5) : 0.2 * model.M + 0.004 * model.K;
  Eigen::VectorXd direction = Eigen::VectorXd::Zero(f);
  direction[0] = 1.0;
  for (const double side : {1.0, -1.0}) {
    Contact contact;
    contact.w = side * direction;
    contact.clearance = random.uniform(0.04, 0.06);
    contact.restitution = 0.7;
    model.contacts.push_back(contact);
  }
  scene.truth.start = {Eigen::VectorXd::Zero(f), 0.3 * direction};
  scene.prior.start = {0.03 * direction, Eigen::VectorXd::Zero(f)};
  model.forces.push_back(
      {direction,
       0.0,
       {},
       sampled(1e-3, duration + 1.0,
               {.interpolation = Interpolation::spline, .outside = Outside::hold})});
  return scene;
}

std::vector<ContactEvent> events_of(const Scene& machine, double jitter, std::uint64_t seed) {
  std::vector<ContactEvent> events = test::events_of(machine, duration);
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

const FittedUnknown& fitted(const Identification& fit, const std::string& key) {
  return *std::find_if(fit.unknowns.begin(), fit.unknowns.end(),
                       [&](const FittedUnknown& of) { return of.unknown.key == key; });
}

TEST(RecordedIdentification, FindsGainAndDelay) {
  constexpr std::uint64_t seed = 71;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  constexpr double dt = 0.01;
  for (int i = 0; i < 4; ++i) {
    const Scene truth = rattle(random, 1 + i % 2, i == 3);
    const auto events = events_of(truth, 0.0, seed);
    // The record has another gain, and its times lack half a sample.
    const double gain = 1.15, delay = 0.5 * dt;
    std::vector<double> t, values;
    for (double at = 0.0; at < duration + 1.0; at += dt) {
      t.push_back(at - delay);
      values.push_back(signal(at) / gain);
    }
    const Scene given = with_input(
        truth, {t, values, {.interpolation = Interpolation::spline, .outside = Outside::hold}});
    IdentificationSettings settings;
    settings.unknowns = unknowns_named(given, {"force.1.gain", "force.1.delay"});
    settings.jitter = 1e-5;
    const Identification fit = identify(given, events, settings);
    std::cout << "gain " << fitted(fit, "force.1.gain").value << " +- "
              << fitted(fit, "force.1.gain").sigma << ", delay "
              << fitted(fit, "force.1.delay").value << " +- " << fitted(fit, "force.1.delay").sigma
              << ", impacts " << fit.impacts << '\n';
    ASSERT_TRUE(fit.fits()) << static_cast<int>(fit.problem) << " scatter " << fit.scatter;
    EXPECT_NEAR(fitted(fit, "force.1.gain").value, gain, 0.01 * gain);
    EXPECT_NEAR(fitted(fit, "force.1.delay").value, delay, 0.05 * delay);
  }
}

}  // namespace
}  // namespace sprag
