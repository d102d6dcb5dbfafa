// Claims of identification on random machines with known parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>
#include <numbers>
#include <random>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/identification.h"
#include "studies/identification/records.h"
#include "tests/identification/ball.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using identification_study::error_of;
using test::events_of;
using test::shipped_scene;

class Draw {
 public:
  explicit Draw(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double normal() { return std::normal_distribution<double>()(engine_); }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }

 private:
  std::mt19937_64 engine_;
};

// A machine, its unknowns, and the admissible errors of the scene.
struct Machine {
  std::string kind;
  Scene scene;
  std::vector<std::string> keys;
  double duration = 0.0;
  int most_impacts = 0;
};

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

Machine drawn_ball(Draw& draw) {
  const double drag = draw.whole(0, 1) == 0 ? 0.0 : draw.uniform(0.05, 0.3);
  Machine machine{
      "ball",
      test::ball(text(drag), "law = \"newton\"\nrestitution = " + text(draw.uniform(0.75, 0.97)),
                 "[master]\nq = [" + text(draw.uniform(0.2, 0.6)) + "]\n"),
      {"impact.restitution"},
      20.0,
      draw.whole(12, 24)};
  if (drag > 0.0) machine.keys.emplace_back("system.C");
  return machine;
}

Machine drawn_rattle(Draw& draw) {
  const double k = 0.2 * std::pow(2.0 * std::numbers::pi * draw.uniform(1.0, 12.0), 2);
  const std::string scene =
      "[system]\nM = [[0.2]]\nK = [[" + text(k) + "]]\nC = [[" + text(draw.uniform(0.1, 0.6)) +
      "]]\n[excitation]\ninfluence = 1.0\namplitude = 0.5e-3\nfrequency = " +
      text(2.0 * std::numbers::pi * draw.uniform(15.0, 40.0)) +
      "\nphase = " + text(draw.uniform(-3.0, 3.0)) +
      "\n[impact]\nlaw = \"newton\"\nrestitution = " + text(draw.uniform(0.4, 0.85)) +
      "\n[[contact]]\ndirection = [1.0]\nclearance = " + text(draw.uniform(0.2e-3, 0.6e-3)) +
      "\nmount = \"frame\"\n[[contact]]\ndirection = [-1.0]\nclearance = " +
      text(draw.uniform(0.2e-3, 0.8e-3)) + "\nmount = \"frame\"\n[master]\n[replica]\n";
  Scene parsed = parse_scene(scene, "rattle.toml");
  std::vector<std::string> keys = identification_study::usual_keys(parsed);
  return {"rattle", std::move(parsed), std::move(keys), 4.0, 90};
}

// The scale of its motion is unobservable.
Machine drawn_without_scale(Draw& draw) {
  const std::string scene = "[system]\nM = [[1.0]]\nC = [[" + text(draw.uniform(0.02, 0.1)) +
                            "]]\nK = [[" + text(draw.uniform(50.0, 500.0)) +
                            "]]\n[impact]\nrestitution = " + text(draw.uniform(0.9, 0.98)) +
                            "\n[[contact]]\ndirection = [1.0]\n[master]\nq = [0.2]\n[replica]\n";
  return {"no scale", parse_scene(scene, "no_scale.toml"), {"system.K"}, 20.0, 20};
}

// The scene of a user: the unknowns are off by up to `share`, phases by up to a radian.
Scene off(const Machine& machine, double share, Draw& draw) {
  const std::vector<Unknown> unknowns = unknowns_named(machine.scene, machine.keys);
  Eigen::VectorXd values = nominal_values(unknowns);
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    double& value = values[static_cast<Eigen::Index>(k)];
    const Unknown& unknown = unknowns[k];
    if (unknown.kind == Unknown::Kind::phase) {
      value += draw.uniform(-1.0, 1.0);
    } else if (unknown.kind == Unknown::Kind::frequency) {
      value *= 1.0 + 0.05 * share * draw.uniform(-1.0, 1.0);
    } else {
      value *= 1.0 + share * draw.uniform(-1.0, 1.0);
    }
    if (unknown.kind == Unknown::Kind::restitution) value = std::min(value, 0.995);
  }
  return with(machine.scene, unknowns, values);
}

std::vector<ContactEvent> recorded(const Machine& machine, double jitter, Draw& draw) {
  std::vector<ContactEvent> events = events_of(machine.scene, machine.duration);
  const auto most = static_cast<std::size_t>(machine.most_impacts);
  if (events.size() > most) events.resize(most);
  double last = 0.0;
  for (ContactEvent& event : events) {
    last = event.t = std::max(last, event.t + jitter * draw.normal());
  }
  return events;
}

double usual_flight(const std::vector<ContactEvent>& events) {
  return (events.back().t - events.front().t) / static_cast<double>(events.size());
}

// The largest error of a determined value in its claimed sigma; 0 for rounding errors.
double worst_error(const Machine& machine, const Scene& scene, const Identification& found) {
  double worst = 0.0;
  for (const FittedUnknown& fitted : found.unknowns) {
    if (!fitted.determined) continue;
    const Unknown as_truth = unknown_of(machine.scene, fitted.unknown.key);
    double truth = as_truth.nominal;
    // A factor on a matrix: the ratio of the machine's matrix to the scene's.
    if (fitted.unknown.key == "system.C") truth = machine.scene.model.C(0, 0) / scene.model.C(0, 0);
    if (fitted.unknown.key == "system.K") truth = machine.scene.model.K(0, 0) / scene.model.K(0, 0);
    const double error = std::abs(error_of(fitted.unknown, fitted.value, truth));
    const double sigma =
        std::max(fitted.sigma, (fitted.high - fitted.low) / 4.0) / fitted.unknown.slope(truth);
    if (error > 1e-7) worst = std::max(worst, error / std::abs(sigma));
  }
  return worst;
}

TEST(Solutions, NoValueIsFarFromTheMachine) {
  const unsigned seed = 20;
  Draw draw(seed);
  int trials = 0, accepted = 0;
  const std::vector<std::function<Machine(Draw&)>> kinds{drawn_ball, drawn_rattle,
                                                         drawn_without_scale};
  for (int i = 0; i < repetitions(24); ++i) {
    for (const auto& kind : kinds) {
      const Machine machine = kind(draw);
      const double jitter_share = std::vector{0.0, 1e-4, 1e-3}[static_cast<std::size_t>(i % 3)];
      const auto exact = recorded(machine, 0.0, draw);
      if (exact.size() < 10) continue;
      const double jitter = jitter_share * usual_flight(exact);
      const Scene scene = off(machine, 0.1, draw);
      IdentificationSettings settings;
      settings.unknowns = unknowns_named(scene, machine.keys);
      if (jitter > 0.0 && i % 2 == 0) settings.jitter = jitter;
      const auto events = recorded(machine, jitter, draw);
      Identification found;
      try {
        found = identify(scene, events, settings);
      } catch (const TooFewImpacts&) {
        continue;
      }
      ++trials;
      if (!found.fits()) {
        std::cout << machine.kind << ' ' << i << ": " << name_of(found.problem) << '\n';
        continue;
      }
      ++accepted;
      EXPECT_LT(worst_error(machine, scene, found), 6.0) << machine.kind << ' ' << i;
      EXPECT_GE(found.used_share(), 0.9);
    }
  }
  std::cout << "seed " << seed << ": " << accepted << " of " << trials << " accepted\n";
  EXPECT_GE(accepted, 0.9 * trials);
}

// Its flights are known: an interval near an integer multiple of its neighbours contains a missed
// impact.
TEST(Solutions, LostBounceIsFoundForAnyJitter) {
  const unsigned seed = 21;
  Draw draw(seed);
  int trials = 0, found_lost = 0;
  for (int i = 0; i < repetitions(8); ++i) {
    Machine machine = drawn_ball(draw);
    machine.most_impacts = 16;
    const double jitter = 3e-4;
    auto events = recorded(machine, jitter, draw);
    if (events.size() < 16 || events[15].t - events[14].t < 0.1) continue;
    const auto lost = static_cast<std::size_t>(draw.whole(4, 11));
    const double t = events[lost].t;
    events.erase(events.begin() + static_cast<std::ptrdiff_t>(lost));
    for (const std::optional<double> given :
         {std::optional<double>(), std::optional(jitter), std::optional(10.0 * jitter)}) {
      const Scene scene = off(machine, 0.05, draw);
      IdentificationSettings settings;
      settings.unknowns = unknowns_named(scene, machine.keys);
      settings.jitter = given;
      const Identification found = identify(scene, events, settings);
      ++trials;
      const bool is_found = found.fits() && found.missing.size() == 1 && found.spurious.empty() &&
                            std::abs(found.missing[0].t - t) < 0.02;
      if (is_found) {
        ++found_lost;
      } else {
        std::cout << i << ", jitter " << given.value_or(-1.0) << ": " << name_of(found.problem)
                  << ", " << found.missing.size() << " lost\n";
      }
    }
  }
  std::cout << "seed " << seed << ": " << found_lost << " of " << trials << " found\n";
  EXPECT_EQ(found_lost, trials);
}

// A machine outside the family: the fit is refused, or claims nothing.
TEST(Solutions, AWrongMachineIsRefused) {
  const unsigned seed = 22;
  Draw draw(seed);
  int trials = 0, accepted = 0;
  const auto attempt = [&](const Scene& scene, std::vector<std::string> keys, double within,
                           const std::vector<ContactEvent>& events, const char* kind) {
    IdentificationSettings settings;
    settings.unknowns = unknowns_named(scene, keys);
    for (Unknown& unknown : settings.unknowns) unknown.within = within;
    const Identification found = identify(scene, events, settings);
    ++trials;
    const bool claims = std::any_of(found.unknowns.begin(), found.unknowns.end(),
                                    [](const FittedUnknown& of) { return of.determined; });
    if (!found.fits() || !claims) return;
    ++accepted;
    std::cout << kind << " accepted, scatter " << found.scatter << '\n';
  };
  for (int i = 0; i < repetitions(6); ++i) {
    // Times of a clock that is 1 % fast, with the frequency fixed.
    const Machine rattle = drawn_rattle(draw);
    auto events = recorded(rattle, 0.0, draw);
    for (ContactEvent& event : events) event.t *= 1.01;
    std::vector<std::string> keys = rattle.keys;
    std::erase(keys, "excitation.frequency");
    attempt(rattle.scene, keys, 0.05, events, "clock");
    // A restitution fixed with an error of 3 %.
    Scene wrong = rattle.scene;
    for (Contact& contact : wrong.model.contacts) contact.restitution *= 1.03;
    keys = rattle.keys;
    std::erase(keys, "impact.restitution");
    attempt(wrong, keys, 0.05, recorded(rattle, 0.0, draw), "restitution");
  }
  // Another kind of damping, and one mode too few.
  const Scene three = shipped_scene("paper_beam");
  const auto keys = identification_study::usual_keys(three);
  for (const char* with : {"modes = 3\ndamping_ratio = 0.04", "modes = 4\ndamping = 0.17"}) {
    if (sanitized) break;
    const Scene other = parse_scene(
        "[beam]\n" + std::string(with) +
            "\nlength = 1.0\nbending_stiffness = 1.0\nmass_per_length = 1.0\n[excitation]\n"
            "amplitude = 0.03\nfrequency = 9.5\n[impact]\nrestitution = 0.7\n[[contact]]\n"
            "position = 0.868\n[master]\nq = [-0.05]\n[replica]\n",
        "other.toml");
    attempt(three, keys, 0.1, events_of(other, 50.0), with);
  }
  std::cout << "seed " << seed << ": " << accepted << " of " << trials << " accepted\n";
  EXPECT_EQ(accepted, 0);
}

// The drag is 0, the limit of its range: a one-sided interval.
TEST(Solutions, AnOptimumAtABoundIsOneSided) {
  const Scene machine =
      test::ball("0.0", "law = \"newton\"\nrestitution = 0.9483", "[master]\nq = [0.2]\n");
  const Scene scene = test::ball("0.1", "law = \"newton\"\nrestitution = 0.93", "[master]\n");
  int at_bound = 0, covered = 0;
  const int runs = repetitions(20);
  for (int seed = 1; seed <= runs; ++seed) {
    Draw draw(static_cast<unsigned>(seed));
    const Machine ball{"ball", machine, {}, 20.0, 16};
    IdentificationSettings settings;
    settings.unknowns = unknowns_named(scene, {"impact.restitution", "system.C"});
    settings.unknowns[1].within = 4.0;
    settings.jitter = 5e-4;
    const Identification found = identify(scene, recorded(ball, 5e-4, draw), settings);
    ASSERT_TRUE(found.fits()) << "seed " << seed << ' ' << name_of(found.problem);
    const FittedUnknown& drag = found.unknowns[1];
    EXPECT_TRUE(drag.determined);
    EXPECT_LT(std::abs(found.unknowns[0].value - 0.9483), 6.0 * found.unknowns[0].sigma);
    if (drag.at_bound) {
      ++at_bound;
      EXPECT_EQ(drag.value, 0.0);
      EXPECT_GT(drag.high, 0.0);
      EXPECT_LT(drag.high, 1.0);
    }
    if (drag.low <= 0.0) ++covered;
  }
  std::cout << "seeds 1 to " << runs << ": " << at_bound << " at the bound, " << covered
            << " intervals contain it\n";
  if (sanitized) return;
  // Half of the unconstrained optima would be beyond the limit.
  EXPECT_GE(at_bound, 4);
  EXPECT_LE(at_bound, 16);
  EXPECT_GE(covered, 17);
}

// A ball with one impact per period: many machines have the same events.
TEST(Solutions, PeriodicOrbitLeavesParametersUndetermined) {
  const Scene scene = test::ball("0.0", "law = \"newton\"\nrestitution = 0.5",
                                 "motion = { amplitude = 0.0035, frequency = 60.0, phase = "
                                 "2.188314299407753 }\n[master]\nq = [0.0020265465649490413]\n"
                                 "u = [0.5136503988619312]\n[replica]\n");
  const Machine locked{"locked", scene, {}, 6.4, 60};
  Draw draw(4);
  for (const std::optional<double> given : {std::optional<double>(), std::optional(1e-4)}) {
    IdentificationSettings settings;
    settings.unknowns = all_but_the_scale(scene);
    settings.jitter = given;
    const Identification found = identify(scene, recorded(locked, 1e-4, draw), settings);
    for (const FittedUnknown& fitted : found.unknowns) {
      if (!found.fits() || !fitted.determined) continue;
      EXPECT_LT(std::abs(error_of(fitted.unknown, fitted.value, fitted.unknown.nominal)),
                6.0 * fitted.sigma / std::abs(fitted.unknown.slope(fitted.value)))
          << fitted.unknown.key;
    }
    EXPECT_FALSE(found.fits() && found.unknowns[0].determined) << "the restitution";
  }
}

// A sufficiently large motion fits any periodic record, because no force sets its scale.
TEST(Solutions, MotionWithUnobservableScaleIsNotAFit) {
  const Scene beam = shipped_scene("paper_beam");
  std::vector<ContactEvent> events;
  for (int k = 1; k < 80; ++k) events.push_back({0.3 * k, 0, ContactEventKind::pulse});
  IdentificationSettings settings;
  settings.unknowns = unknowns_named(beam, identification_study::usual_keys(beam));
  settings.jitter = 1e-6;
  const Identification found = identify(beam, events, settings);
  EXPECT_EQ(found.problem, FitProblem::degenerate_orbit) << name_of(found.problem);
  for (const FittedUnknown& fitted : found.unknowns) EXPECT_FALSE(fitted.determined);
}

// Each impact has a different restitution.
TEST(Solutions, DeviationIncludesScatterOfRestitution) {
  double squares = 0.0;
  int values = 0;
  const int runs = repetitions(24);
  for (int seed = 1; seed <= runs; ++seed) {
    Draw draw(static_cast<unsigned>(seed));
    std::vector<ContactEvent> events;
    double t = 0.1, speed = 3.2;
    for (int k = 0; k < 22; ++k) {
      events.push_back({t + 1e-4 * draw.normal(), 0, ContactEventKind::pulse});
      speed *= 0.89 + 0.003 * draw.normal();
      t += 2.0 * speed / 9.81;
    }
    const Scene scene = test::ball("0.0", "law = \"newton\"\nrestitution = 0.85", "[master]\n");
    IdentificationSettings settings;
    settings.unknowns = unknowns_named(scene, {"impact.restitution"});
    const Identification found = identify(scene, events, settings);
    ASSERT_TRUE(found.fits()) << "seed " << seed << ' ' << reason_of(found);
    const double off = (found.unknowns[0].value - 0.89) / found.unknowns[0].sigma;
    EXPECT_LT(std::abs(off), 5.0) << "seed " << seed;
    squares += off * off;
    ++values;
  }
  std::cout << "seeds 1 to " << runs << ": mean square " << squares / values << '\n';
  if (sanitized) return;
  EXPECT_LT(squares, 2.0 * values);
  EXPECT_GT(squares, 0.2 * values);
}

// The motion keeps its scale if the scale is unobservable.
TEST(Solutions, UnobservableScaleKeepsMotion) {
  Draw draw(5);
  const Machine machine = drawn_without_scale(draw);
  const auto events = recorded(machine, 3e-4, draw);
  const Scene scene = off(machine, 0.02, draw);
  IdentificationSettings settings;
  settings.unknowns = unknowns_named(scene, machine.keys);
  const Identification found = identify(scene, events, settings);
  ASSERT_TRUE(found.fits());
  EXPECT_GT(found.start.q.norm() + found.start.u.norm(), 1e-3);
  EXPECT_NEAR(found.scatter, 3e-4, 1.5e-4);
  EXPECT_LT(worst_error(machine, scene, found), 6.0);
}

TEST(Solutions, EventIsNotRepairedByMovingIt) {
  Draw draw(6);
  Machine machine = drawn_ball(draw);
  auto events = recorded(machine, 1e-4, draw);
  events[events.size() / 2].t += 6e-3;
  IdentificationSettings settings;
  settings.unknowns = unknowns_named(machine.scene, machine.keys);
  settings.jitter = 1e-4;
  const Identification found = identify(machine.scene, events, settings);
  EXPECT_EQ(found.problem, FitProblem::lost_or_spurious_events) << name_of(found.problem);
}

}  // namespace
}  // namespace sprag
