// The contact clock as an unknown: t_clock = offset + rate t.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <random>

#include "sprag/detail/identification/explanations.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/identification.h"
#include "tests/identification/ball.h"
#include "tests/identification/fitted_unknown.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::events_of;
using test::shipped_scene;

// A ball under gravity on a table that moves.
Scene table_ball() {
  return test::ball("0.05", "law = \"newton\"\nrestitution = 0.6",
                    "motion = { amplitude = 0.03, frequency = 25.0 }\n[master]\nq = [0.1]\n"
                    "[replica]\nq = [0.1]\n");
}

// A mass between two stops, shaken with the stops.
Scene rattle() {
  return parse_scene(R"(
[system]
M = [[0.2]]
K = [[300.0]]
C = [[0.3]]
[excitation]
influence = 1.0
amplitude = 0.5e-3
frequency = 150.0
phase = 0.4
[impact]
law = "newton"
restitution = 0.7
[[contact]]
direction = [1.0]
clearance = 0.4e-3
mount = "frame"
[[contact]]
direction = [-1.0]
clearance = 0.5e-3
mount = "frame"
[master]
[replica]
)",
                     "rattle.toml");
}

// Two masses with forces of two frequencies, and damping that couples the modes.
Scene two_masses() {
  return parse_scene(R"(
[system]
M = [[1.0, 0.0], [0.0, 0.5]]
C = [[0.9, -0.1], [-0.1, 0.2]]
K = [[300.0, -100.0], [-100.0, 100.0]]
[[force]]
direction = [1.0, 0.0]
amplitude = 8.0
frequency = 9.0
[[force]]
direction = [0.0, 1.0]
amplitude = 4.0
frequency = 5.3
phase = 0.7
[[force]]
direction = [0.0, 1.0]
constant = -1.0
[impact]
restitution = 0.6
[[contact]]
direction = [0.0, 1.0]
clearance = 0.02
[master]
q = [0.05, 0.08]
[replica]
q = [0.0, 0.0]
)",
                     "two_masses.toml");
}

// Impacts of a scene's machine, as many as a fit takes.
std::vector<ContactEvent> impacts_of(const Scene& scene, double duration) {
  std::vector<ContactEvent> events = events_of(scene, duration);
  constexpr std::size_t most = 120;
  if (events.size() > most) events.resize(most);
  return events;
}

std::vector<ContactEvent> by_clock(std::vector<ContactEvent> events, const ContactClock& clock,
                                   double jitter = 0.0, unsigned seed = 0) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  double last = 0.0;
  for (ContactEvent& event : events) {
    const double noise = jitter > 0.0 ? jitter * normal(engine) : 0.0;
    last = event.t = std::max(last, clock_time(clock, event.t) + noise);
  }
  return events;
}

Identification fit(const Scene& scene, const std::vector<ContactEvent>& events,
                   const std::vector<std::string>& keys, std::optional<double> jitter) {
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, keys);
  settings.jitter = jitter;
  return identify(scene, events, settings);
}

// By the claimed sigma, with the start and other parameters unknown as well.
TEST(Clock, RateIsFoundToItsSigma) {
  struct Case {
    Scene scene;
    std::vector<std::string> keys;
    double duration, jitter;
  };
  std::vector<Case> cases{
      {table_ball(), {"impact.restitution", "clock.rate", "contact.1.motion.phase"}, 12.0, 1e-4},
      {rattle(), {"clock.rate", "impact.restitution", "excitation.phase"}, 4.0, 1e-5},
      {two_masses(), {"clock.rate", "clock.offset"}, 40.0, 2e-4}};
  if (thorough()) {
    cases.push_back(
        {shipped_scene("paper_beam"), {"clock.rate", "impact.restitution"}, 60.0, 1e-4});
  }
  double sum = 0.0, of_all = 0.0;
  const ContactClock clock{.offset = 0.003, .rate = 1.0002};
  for (const Case& of : cases) {
    double squares = 0.0, largest_sigma = 0.0;
    int refused = 0;
    const int runs = long_repetitions(32);
    const std::vector<ContactEvent> exact = impacts_of(of.scene, of.duration);
    for (int seed = 1; seed <= runs; ++seed) {
      // Only a sought offset or phase may take the shift of the times.
      const bool shifted = of.keys.back() != "impact.restitution";
      const ContactClock recorded{.offset = shifted ? clock.offset : 0.0, .rate = clock.rate};
      const auto events = by_clock(exact, recorded, of.jitter, static_cast<unsigned>(seed));
      const Identification found = fit(of.scene, events, of.keys, of.jitter);
      if (!found.fits()) {
        // A fit of a chaotic path may end in a valley. It is refused and claims nothing.
        EXPECT_EQ(found.problem, FitProblem::degenerate_orbit) << of.scene.name << " seed " << seed;
        ++refused;
        continue;
      }
      const FittedUnknown& rate = fitted(found, "clock.rate");
      ASSERT_TRUE(rate.determined);
      const double z = (rate.value - clock.rate) / rate.sigma;
      EXPECT_LT(std::abs(z), 4.5) << of.scene.name << " seed " << seed;
      EXPECT_LT(rate.sigma, 1e-4) << of.scene.name;
      EXPECT_EQ(found.fitted.clock.rate, rate.value);
      if (of.keys.back() == "clock.offset") {
        const FittedUnknown& offset = fitted(found, "clock.offset");
        EXPECT_LT(std::abs(offset.value - clock.offset), 4.5 * offset.sigma) << "seed " << seed;
      }
      squares += z * z;
      largest_sigma = std::max(largest_sigma, rate.sigma);
    }
    EXPECT_LE(refused, runs / 16) << of.scene.name;
    std::cout << of.scene.name << ", seeds 1 to " << runs << ", refused " << refused
              << ": mean of (error / sigma)^2 " << squares / (runs - refused) << ", largest sigma "
              << largest_sigma << '\n';
    sum += squares;
    of_all += runs - refused;
  }
  if (sanitized) return;
  // Of 24 errors chi^2 / 24 is outside of [0.4, 1.9] once in 150 trials.
  std::cout << "all: " << sum / of_all << '\n';
  EXPECT_GT(sum / of_all, 0.4);
  EXPECT_LT(sum / of_all, 1.9);
}

// The fitted scene is that of the machine, with a start at the machine's t = 0.
TEST(Clock, StartIsThatOfTheMachine) {
  for (const double offset : {0.0, 0.02, -0.03}) {
    Scene scene = two_masses();
    scene.truth.start.u = Eigen::Vector2d(0.3, -0.4);
    const ContactClock clock{.offset = offset, .rate = 1.002};
    const auto events = by_clock(impacts_of(scene, 40.0), clock);
    const Identification found = fit(scene, events, {"clock.rate", "clock.offset"}, 0.0);
    ASSERT_TRUE(found.fits()) << name_of(found.problem);
    EXPECT_NEAR(found.fitted.clock.rate, clock.rate, 1e-9);
    EXPECT_NEAR(found.fitted.clock.offset, clock.offset, 1e-8);
    EXPECT_EQ(found.start_t, 0.0);
    EXPECT_EQ(found.begins, 0.0);
    EXPECT_LT((found.start.q - scene.truth.start.q).norm(), 1e-7);
    EXPECT_LT((found.start.u - scene.truth.start.u).norm(), 1e-6);
  }
}

TEST(Clock, ScaledTimesMayBeThoseOfAnotherMachine) {
  // Nothing has a unit of time: heights are unknown.
  const Scene ball =
      test::ball("0.0", "law = \"newton\"\nrestitution = 0.9", "[master]\nq = [0.5]\n");
  const auto of_ball = by_clock(impacts_of(ball, 5.0), {.offset = 0.0, .rate = 1.0002}, 1e-5, 1);
  for (const std::vector<std::string>& keys :
       {std::vector<std::string>{"clock.rate", "impact.restitution"},
        std::vector<std::string>{"clock.rate", "impact.restitution", "force.1.constant"}}) {
    const Identification found = fit(ball, of_ball, keys, 1e-5);
    const FittedUnknown& rate = fitted(found, "clock.rate");
    EXPECT_FALSE(rate.determined);
    EXPECT_EQ(rate.value, 1.0);
    ASSERT_EQ(found.ambiguities.size(), 1U);
    EXPECT_EQ(found.ambiguities[0].key, "clock.rate");
    EXPECT_TRUE(found.ambiguities[0].equals.empty());
    EXPECT_NEAR(fitted(found, "impact.restitution").value, 0.9, 1e-3);
  }

  const Scene beam = shipped_scene("paper_beam");
  const std::vector<std::string> all{"clock.rate", "beam.damping", "beam.bending_stiffness",
                                     "excitation.frequency"};
  const auto ambiguity = [](const Scene& scene, const std::vector<std::string>& keys) {
    return clock_ambiguity(scene, parameters_named(scene, keys), parameter_of(scene, keys.front()));
  };
  ASSERT_TRUE(ambiguity(beam, all));
  EXPECT_EQ(
      ambiguity(beam, all)->equals,
      (std::vector<std::string>{"beam.bending_stiffness", "beam.damping", "excitation.frequency"}));
  EXPECT_NE(to_text(*ambiguity(beam, all)).find("Hold one of them: leave it out"),
            std::string::npos);
  // Each of them held determines the rate.
  for (std::size_t k = 1; k < all.size(); ++k) {
    std::vector<std::string> keys = all;
    keys.erase(keys.begin() + static_cast<std::ptrdiff_t>(k));
    EXPECT_FALSE(ambiguity(beam, keys)) << all[k];
  }
  // The times of the table's motion and of gravity in a known length.
  const Scene table = table_ball();
  const std::vector<std::string> of_table{"clock.rate", "contact.1.motion.frequency", "system.C"};
  EXPECT_FALSE(ambiguity(table, of_table));
  EXPECT_TRUE(ambiguity(table, {"clock.rate", "contact.1.motion.frequency", "system.C",
                                "contact.1.motion.amplitude"}));
  EXPECT_TRUE(ambiguity(beam, {"clock.offset", "excitation.phase"}));
  EXPECT_FALSE(ambiguity(beam, {"clock.offset", "clock.rate"}));
  EXPECT_FALSE(ambiguity(two_masses(), {"clock.offset", "force.1.phase"}));
}

// The claim of the ambiguity: a machine with stiffness, damping and frequency changed has the same
// times, so that the fit of these finds the scaled machine.
TEST(Clock, AmbiguousFitFindsTheScaledMachine) {
  const Scene beam = shipped_scene("paper_beam");
  const double rate = 1.001;
  const auto events = by_clock(impacts_of(beam, 60.0), {.offset = 0.0, .rate = rate});
  const Identification found =
      fit(beam, events,
          {"clock.rate", "beam.damping", "beam.bending_stiffness", "excitation.frequency"}, 0.0);
  ASSERT_TRUE(found.fits()) << name_of(found.problem);
  EXPECT_FALSE(fitted(found, "clock.rate").determined);
  EXPECT_NEAR(fitted(found, "beam.damping").value, 0.17 / rate, 1e-7);
  EXPECT_NEAR(fitted(found, "beam.bending_stiffness").value, 1.0 / (rate * rate), 1e-7);
  EXPECT_NEAR(fitted(found, "excitation.frequency").value, 9.5 / rate, 1e-7);
  // Held, each of them makes the rate known.
  const Identification held =
      fit(beam, events, {"clock.rate", "beam.damping", "beam.bending_stiffness"}, 0.0);
  ASSERT_TRUE(held.fits()) << name_of(held.problem);
  EXPECT_NEAR(fitted(held, "clock.rate").value, rate, 1e-8);
  EXPECT_NEAR(fitted(held, "beam.damping").value, 0.17, 1e-6);
}

}  // namespace
}  // namespace sprag
