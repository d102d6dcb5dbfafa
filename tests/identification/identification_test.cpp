#include "sprag/identification.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <random>

#include "sprag/detail/identification/explanations.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"
#include "studies/identification/records.h"
#include "tests/identification/ball.h"
#include "tests/support/jitter.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using identification_study::error_of;
using identification_study::usual_keys;
using test::events_of;
using test::shipped_scene;

// Jittered times in the order of the events: a report waits for the one before.
std::vector<ContactEvent> in_order(std::vector<ContactEvent> events, double jitter, int seed) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(seed));
  return test::jittered(std::move(events), jitter, engine);
}

// The last impacts of a chatter are closer than the error of their times, and coincide if a report
// waits for the previous one. A path through these times is 2.7 sigma off in these parameters (NEES
// 7), and seems to drift.
TEST(Identification, SigmasAreCalibratedAfterChatter) {
  constexpr double jitter = 1e-4;
  const Scene scene = shipped_scene("two_stops_beam");
  const auto events = events_of(scene, 20.0);
  IdentificationSettings settings;
  settings.unknowns =
      parameters_named(scene, {"impact.restitution", "beam.damping", "beam.bending_stiffness"});
  for (Parameter& unknown : settings.unknowns) unknown.within = 0.05;
  settings.jitter = jitter;
  settings.mend = false;
  double squares = 0.0;
  int values = 0;
  const int runs = long_repetitions(8);
  for (int seed = 1; seed <= runs; ++seed) {
    const Identification found = identify(scene, in_order(events, jitter, seed), settings);
    std::cout << "seed " << seed << ": chi^2 " << found.chi2 << " for " << found.freedom;
    if (found.fits()) {
      const auto& drift = found.departure.drift;
      ASSERT_TRUE(drift);
      EXPECT_FALSE(drift->found()) << "seed " << seed << ", gain " << drift->gain;
      EXPECT_GT(drift->high, 1e-10);
      EXPECT_FALSE(found.departure.is_scatter())
          << "seed " << seed << ", scatter " << found.departure.scatter->scatter << ", gain "
          << found.departure.scatter->gain;
      for (const FittedUnknown& fitted : found.unknowns) {
        const double off = (fitted.value - fitted.unknown.nominal) / fitted.sigma;
        std::cout << ", " << off << " (" << fitted.sigma << ")";
        EXPECT_LT(std::abs(off), 4.0) << "seed " << seed << ' ' << fitted.unknown.key;
        squares += off * off;
        ++values;
      }
    }
    std::cout << '\n';
  }
  // One run may be refused, but none may claim a wrong value.
  EXPECT_GE(values, 3 * (runs - runs / 5));
  if (!sanitized) {
    EXPECT_LT(squares, 2.0 * values);
    EXPECT_GT(squares, 0.4 * values);
  }
}

constexpr double jitter_of_mended = 1e-4;

std::vector<ContactEvent> jittered_events(const Scene& scene, double duration, unsigned seed) {
  auto events = events_of(scene, duration);
  std::mt19937 random(seed);
  std::normal_distribution<double> jitter(0.0, jitter_of_mended);
  for (ContactEvent& event : events) event.t += jitter(random);
  return events;
}

// The default parameters are known to 3 %.
Identification mended(const Scene& scene, const std::vector<ContactEvent>& events) {
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, usual_keys(scene));
  for (Parameter& unknown : settings.unknowns) unknown.within = 0.03;
  settings.jitter = jitter_of_mended;
  return identify(scene, events, settings);
}

// The path is also followed backwards: some of the first events are missing, including the very
// first, and others are spurious.
TEST(Identification, StartOfRecordIsRepaired) {
  if (sanitized) GTEST_SKIP() << "takes too long with sanitizers";
  const Scene scene = shipped_scene("paper_beam");
  auto events = jittered_events(scene, 30.0, 11);
  const std::vector<std::size_t> lost{0, 8, 15, 16};
  std::vector<double> lost_at;
  for (const std::size_t k : lost) lost_at.push_back(events[k].t);
  for (auto k = lost.rbegin(); k != lost.rend(); ++k) {
    events.erase(events.begin() + static_cast<std::ptrdiff_t>(*k));
  }
  for (const double t : {4.0, 9.0}) {
    const auto later = std::find_if(events.begin(), events.end(),
                                    [t](const ContactEvent& event) { return event.t > t; });
    events.insert(later, {t, 0, ContactEventKind::pulse});
  }
  const Identification found = mended(scene, events);
  EXPECT_TRUE(found.fits());
  EXPECT_EQ(found.spurious.size(), 2U);
  ASSERT_EQ(found.missing.size(), lost.size());
  for (std::size_t k = 0; k < lost.size(); ++k) {
    EXPECT_NEAR(found.missing[k].t, lost_at[k], 5e-3);
  }
  EXPECT_EQ(found.start_t, 0.0);
}

// No piece between lost events determines the machine, but several of them together do. Several
// consecutive events are lost as well.
TEST(Identification, ShortPiecesJointlyDetermineMachine) {
  if (sanitized) GTEST_SKIP() << "takes too long with sanitizers";
  const Scene scene = shipped_scene("paper_beam");
  auto events = jittered_events(scene, 60.0, 13);
  ASSERT_GT(events.size(), 80U);
  const std::vector<std::size_t> lost{75, 64, 63, 62, 61, 60, 45, 30, 29, 15};
  for (const std::size_t k : lost) events.erase(events.begin() + static_cast<std::ptrdiff_t>(k));
  const Identification found = mended(scene, events);
  EXPECT_TRUE(found.fits());
  EXPECT_TRUE(found.spurious.empty());
  EXPECT_EQ(found.missing.size(), lost.size());
}

class IdentificationOfScenes : public testing::TestWithParam<const char*> {};

// Several contacts, coupled damping, sustained contacts, SI units; and single entries of matrices.
TEST_P(IdentificationOfScenes, FindsAllIdentifiableParameters) {
  const Scene machine = shipped_scene(GetParam());
  std::vector<std::string> keys = usual_keys(machine);
  if (GetParam() == std::string("lab_rig")) keys.insert(keys.end(), {"system.C.1.2"});
  const std::vector<Parameter> of_machine = parameters_named(machine, keys);
  Eigen::VectorXd values = nominal_values(of_machine);
  std::mt19937_64 engine(1);
  std::uniform_real_distribution<double> share(-0.05, 0.05);
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const Parameter& unknown = of_machine[static_cast<std::size_t>(k)];
    values[k] = unknown.value(unknown.coordinate(values[k]) + share(engine));
  }
  const Scene wrong = with(machine, of_machine, values);
  std::vector<ContactEvent> events = events_of(machine, 100.0);
  if (events.size() > 100) events.resize(100);
  IdentificationSettings settings;
  settings.unknowns = parameters_named(wrong, keys);
  settings.jitter = 0.0;
  const Identification found = identify(wrong, events, settings);
  ASSERT_TRUE(found.fits()) << reason_of(found);
  EXPECT_LT(found.scatter, 1e-9 * found.interval);
  const Scene& fitted = found.fitted;
  EXPECT_LT((fitted.model.K - machine.model.K).norm(), 1e-6 * machine.model.K.norm());
  EXPECT_LT((fitted.model.C - machine.model.C).norm(), 1e-6 * machine.model.C.norm());
  for (std::size_t i = 0; i < machine.model.contacts.size(); ++i) {
    EXPECT_NEAR(fitted.model.contacts[i].restitution, machine.model.contacts[i].restitution, 1e-6);
  }
  // With the beam of these matrices, and the start at t = 0.
  if (machine.beam) {
    EXPECT_NEAR(fitted.beam->damping, machine.beam->damping, 1e-6 * machine.beam->damping);
  }
  EXPECT_LT((fitted.prior.start.q - machine.truth.start.q).norm(), 1e-6);
  EXPECT_LT((fitted.prior.start.u - machine.truth.start.u).norm(), 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Scenes, IdentificationOfScenes,
                         testing::Values("lab_rig", "two_stops_beam", "non_proportional",
                                         "paper_beam_chatter", "steel_ruler"));

// One number of the machine that is not among the usual parameters.
TEST(Identification, AnyNumberOfTheMachine) {
  const std::pair<const char*, const char*> cases[] = {{"lab_rig", "system.M.2.2"},
                                                       {"lab_rig", "contact.1.direction.1"},
                                                       {"paper_beam", "beam.mass_per_length"},
                                                       {"paper_beam", "beam.length"},
                                                       {"non_proportional", "force.1.direction.2"}};
  for (const auto& [name, key] : cases) {
    SCOPED_TRACE(testing::Message() << name << ": " << key);
    const Scene scene = shipped_scene(name);
    const std::vector<Parameter> unknowns = parameters_named(scene, {key});
    const double truth = unknowns[0].value(0.02);
    const std::vector<ContactEvent> events = events_of(with(scene, unknowns[0], truth), 30.0);
    IdentificationSettings settings;
    settings.unknowns = unknowns;
    settings.jitter = 0.0;
    const Identification found = identify(scene, events, settings);
    EXPECT_TRUE(found.fits()) << reason_of(found);
    EXPECT_NEAR(found.unknowns[0].value, truth, 1e-7 * std::abs(truth));
  }
}

// From C = 0, where the step of a damping is a share of critical damping.
TEST(Identification, ADamperOfAnUndampedMachine) {
  Scene scene = shipped_scene("lab_rig");
  scene.model.C.setZero();
  const std::vector<Parameter> unknowns = parameters_named(scene, {"system.C.2.2"});
  EXPECT_EQ(unknowns[0].coordinate(0.0), unknowns[0].lowest());
  const std::vector<ContactEvent> events = events_of(with(scene, unknowns[0], 0.8), 30.0);
  IdentificationSettings settings;
  settings.unknowns = unknowns;
  settings.jitter = 0.0;
  const Identification found = identify(scene, events, settings);
  EXPECT_TRUE(found.fits()) << reason_of(found);
  EXPECT_NEAR(found.unknowns[0].value, 0.8, 1e-7);
}

struct Sustained {
  const char* scene;
  const char* key;
  double value, duration, jitter;
  int most_stretches;
};

// The path continues through the end of a chatter and the following sustained contact: no stretch
// begins there, so that there are fewer unknowns. Also through impacts of one contact during a
// sustained contact of another.
TEST(Identification, PathContinuesThroughSustainedContacts) {
  for (const Sustained& of :
       {Sustained{"paper_beam_chatter", "impact.restitution", 0.68, 30.0, 1e-5, 2},
        Sustained{"two_supports_beam", "contact.2.clearance", -0.125, 5.0, 0.0, 100}}) {
    const Scene scene = shipped_scene(of.scene);
    const Scene machine = with(scene, parameter_of(scene, of.key), of.value);
    IdentificationSettings settings;
    settings.unknowns = parameters_named(scene, {of.key});
    settings.jitter = of.jitter;
    const Identification found =
        identify(scene, in_order(events_of(machine, of.duration), of.jitter, 5), settings);
    ASSERT_TRUE(found.fits()) << of.scene << ": " << reason_of(found);
    const FittedUnknown& fitted = found.unknowns[0];
    EXPECT_NEAR(fitted.value, of.value, 4.0 * fitted.sigma + 1e-9) << of.scene;
    EXPECT_LT(fitted.sigma, of.jitter > 0.0 ? 1e-4 : 0.01 * std::abs(of.value)) << of.scene;
    EXPECT_LE(found.stretches, of.most_stretches) << of.scene;
  }
}

// A chatter alone does not determine the path, which may even lie inside the support; here its
// first 12 impacts are left out.
TEST(Identification, StretchWithUndeterminedStartIsOmitted) {
  const Scene scene = shipped_scene("two_stops_beam");
  IdentificationSettings settings;
  settings.jitter = 1e-5;
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  auto events = events_of(scene, 10.0);
  for (ContactEvent& event : events) event.t += 1e-5 * normal(engine);
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  const Identification found = identify(scene, events, settings);
  EXPECT_TRUE(found.fits()) << reason_of(found);
  EXPECT_NEAR(found.scatter, 1e-5, 2e-6);
}

// A shaken frame and a force of another frequency, and two contacts with different restitutions.
constexpr const char* two_frequencies = R"(
[system]
M = [[1.0, 0.0], [0.0, 0.7]]
C = [[0.4, -0.1], [-0.1, 0.2]]
K = [[60.0, -20.0], [-20.0, 40.0]]
[excitation]
influence = 1.0
amplitude = 0.03
frequency = 9.0
phase = 0.4
[[force]]
direction = [0.0, 1.0]
amplitude = 1.5
frequency = 4.1
phase = 0.7
[impact]
restitution = 0.7
[[contact]]
direction = [0.0, 1.0]
clearance = 0.01
[[contact]]
direction = [-1.0, 0.0]
clearance = 0.08
restitution = 0.55
[master]
q = [0.0, 0.1]
[replica]
)";

// A common factor of several different numbers is identified like a single number.
TEST(Identification, CommonFactorsAndTheOffsetOfAClock) {
  const Scene scene = parse_scene(two_frequencies, "two_frequencies.toml");
  const struct {
    const char* key;
    double value;
  } cases[] = {{"impact.restitution", 0.95}, {"excitations.frequency", 1.015},
               {"excitations.phase", 0.6},   {"excitations.amplitude", 1.08},
               {"clock.offset", 0.07},       {"clock.offset", -0.2},
               {"excitation.frequency", 9.2}};
  for (const auto& of : cases) {
    const std::vector<Parameter> unknowns = parameters_named(scene, {of.key});
    const Scene changed = with(scene, unknowns, Eigen::VectorXd::Constant(1, of.value));
    auto events = events_of(changed, 30.0);
    for (ContactEvent& event : events) {
      event.t = machine_time(scene.clock, clock_time(changed.clock, event.t));
    }
    IdentificationSettings settings;
    settings.unknowns = unknowns;
    settings.jitter = 0.0;
    const Identification found = identify(scene, events, settings);
    EXPECT_TRUE(found.fits()) << of.key << ' ' << static_cast<int>(found.problem);
    EXPECT_NEAR(found.unknowns[0].value, of.value, 1e-8) << of.key;
  }
  // Reported minus true times.
  auto events = events_of(scene, 30.0);
  for (ContactEvent& event : events) event.t += 0.02;
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, {"clock.offset"});
  settings.jitter = 0.0;
  const Identification found = identify(scene, events, settings);
  EXPECT_TRUE(found.fits());
  EXPECT_NEAR(found.unknowns[0].value, 0.02, 1e-8);
}

TEST(Identification, UnidentifiableParametersAreReported) {
  // One impact per period: the intervals are constant.
  const Scene scene = shipped_scene("impact_oscillator");
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, usual_keys(scene));
  const Identification found = identify(scene, events_of(scene, 10.0), settings);
  EXPECT_TRUE(std::any_of(found.unknowns.begin(), found.unknowns.end(),
                          [](const FittedUnknown& fitted) { return !fitted.determined; }));
}

// In wide ranges the search finds other minima, whose scatter exact times exclude.
TEST(Identification, ExcludedMinimaDoNotRefuseAFit) {
  const Scene scene = shipped_scene("lab_rig");
  Scene machine = scene;
  machine.model.contacts[0].restitution = 0.5656721473;
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, usual_keys(scene));
  for (const double within : {0.3, 0.5, 0.9}) {
    for (Parameter& unknown : settings.unknowns) unknown.within = within;
    const Identification found = identify(scene, events_of(machine, 20.0), settings);
    EXPECT_TRUE(found.fits()) << "within " << within;
    EXPECT_LT(found.scatter, 1e-13);
    EXPECT_TRUE(found.others.empty());
  }
}

TEST(Identification, TooFewImpactsAreReported) {
  const Scene scene = shipped_scene("paper_beam");
  IdentificationSettings settings;
  settings.unknowns = parameters_named(scene, usual_keys(scene));
  EXPECT_THROW(identify(scene, events_of(scene, 4.0), settings), TooFewImpacts);
  EXPECT_THROW(identify(scene, {}, settings), TooFewImpacts);
}

// Times of 30 bounces of a table-tennis ball, read from data/pingpong.wav of the repository
// eepsmedia/ping-pong-bounce (MIT license) to about 0.3 ms; T. Erickson, "Ping-Pong Bounces",
// Mathematics Teacher: Learning and Teaching PK-12, 2020, doi 10.5951/MTLT.2019.0042.
TEST(Identification, AMeasuredBall) {
  const Scene scene =
      test::ball("0.1", "law = \"newton\"\nrestitution = 0.93", "[master]\nu = [0.9]\n");
  std::ifstream file(SPRAG_SOURCE_DIR "/data/ping_pong_bounces.csv");
  std::string line;
  std::getline(file, line);
  std::vector<ContactEvent> events;
  while (std::getline(file, line)) {
    events.push_back({std::stod(line), 0, ContactEventKind::pulse});
  }
  ASSERT_EQ(events.size(), 30U);
  IdentificationSettings settings;
  settings.unknowns =
      parameters_named(scene, {"impact.restitution", "system.C", "contact.1.clearance"});
  settings.unknowns[1].within = 2.0;
  const Identification found = identify(scene, events, settings);
  ASSERT_TRUE(found.fits());
  EXPECT_NEAR(found.unknowns[0].value, 0.9487, 0.0003);
  EXPECT_NEAR(found.unknowns[1].value, 1.15, 0.1);
  EXPECT_FALSE(found.unknowns[2].determined);
  EXPECT_GT(std::abs(found.unknowns[0].correlation), 0.98);
  EXPECT_NEAR(found.jitter, 6e-4, 1e-4);
  // With an unknown drag a speed-dependent restitution is not identifiable; a drift of it is.
  ASSERT_TRUE(found.departure.trend);
  EXPECT_FALSE(found.departure.trend->found());
  EXPECT_GT(found.departure.trend->sigma, 0.01);
  ASSERT_TRUE(found.departure.drift);
  EXPECT_TRUE(found.departure.drift->found());
  EXPECT_NEAR(found.departure.drift->drift, 3e-5, 1e-5);
  settings.unknowns.resize(1);
  const Departure alone = identify(scene, events, settings).departure;
  ASSERT_TRUE(alone.trend);
  EXPECT_FALSE(alone.trend->found());
  EXPECT_NEAR(alone.trend->trend, -9e-4, 4.0 * alone.trend->sigma);
  settings.jitter = 3e-4;
  EXPECT_FALSE(identify(scene, events, settings).fits());
}

// The drag is 0, the limit of its range: a one-sided interval.
TEST(Identification, AnOptimumAtABoundIsOneSided) {
  const Scene machine =
      test::ball("0.0", "law = \"newton\"\nrestitution = 0.9483", "[master]\nq = [0.2]\n");
  const Scene scene = test::ball("0.1", "law = \"newton\"\nrestitution = 0.93", "[master]\n");
  constexpr double jitter = 5e-4;
  auto exact = events_of(machine, 20.0);
  exact.resize(16);
  int at_bound = 0, covered = 0;
  const int runs = repetitions(20);
  for (int seed = 1; seed <= runs; ++seed) {
    IdentificationSettings settings;
    settings.unknowns = parameters_named(scene, {"impact.restitution", "system.C"});
    settings.unknowns[1].within = 4.0;
    settings.jitter = jitter;
    const Identification found = identify(scene, in_order(exact, jitter, seed), settings);
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
TEST(Identification, PeriodicOrbitLeavesParametersUndetermined) {
  const Scene scene = test::ball("0.0", "law = \"newton\"\nrestitution = 0.5",
                                 "motion = { amplitude = 0.0035, frequency = 60.0, phase = "
                                 "2.188314299407753 }\n[master]\nq = [0.0020265465649490413]\n"
                                 "u = [0.5136503988619312]\n[replica]\n");
  auto events = events_of(scene, 6.4);
  events.resize(60);
  for (const std::optional<double> given : {std::optional<double>(), std::optional(1e-4)}) {
    IdentificationSettings settings;
    settings.unknowns = all_but_the_scale(scene);
    settings.jitter = given;
    const Identification found = identify(scene, in_order(events, 1e-4, 4), settings);
    for (const FittedUnknown& fitted : found.unknowns) {
      if (!found.fits() || !fitted.determined) continue;
      EXPECT_LT(std::abs(error_of(fitted.unknown, fitted.value, fitted.unknown.nominal)),
                6.0 * fitted.sigma / std::abs(fitted.unknown.slope(fitted.value)))
          << fitted.unknown.key;
    }
    EXPECT_FALSE(found.fits() && found.unknowns[0].determined) << "the restitution";
  }
}

// One mode too few. In a thorough run also with another kind of damping, with a given jitter, and
// with all parameters unknown.
TEST(Identification, OtherBeamsAreRefused) {
  const Scene three = shipped_scene("paper_beam");
  std::vector<std::string> beams{"modes = 4\ndamping = 0.17"};
  std::vector<std::optional<double>> jitters{{}};
  IdentificationSettings settings;
  settings.unknowns = parameters_named(three, {"impact.restitution", "beam.damping"});
  settings.mend = false;
  if (thorough()) {
    beams.emplace_back("modes = 3\ndamping_ratio = 0.04");
    jitters.emplace_back(1e-4);
    settings.unknowns = parameters_named(three, usual_keys(three));
  }
  for (Parameter& unknown : settings.unknowns) unknown.within = 0.1;
  for (const std::string& beam : beams) {
    const Scene other = parse_scene(
        "[beam]\n" + beam +
            "\nlength = 1.0\nbending_stiffness = 1.0\nmass_per_length = 1.0\n[excitation]\n"
            "amplitude = 0.03\nfrequency = 9.5\n[impact]\nrestitution = 0.7\n[[contact]]\n"
            "position = 0.868\n[master]\nq = [-0.05]\n[replica]\n",
        "other.toml");
    for (const std::optional<double> given : jitters) {
      settings.jitter = given;
      const Identification found = identify(three, events_of(other, 50.0), settings);
      EXPECT_FALSE(found.fits()) << beam << ": " << found.scatter;
    }
  }
}

// A sufficiently large motion fits any periodic record, because no force sets its scale.
TEST(Identification, MotionWithUnobservableScaleIsNotAFit) {
  const Scene beam = shipped_scene("paper_beam");
  std::vector<ContactEvent> events;
  for (int k = 1; k < 80; ++k) events.push_back({0.3 * k, 0, ContactEventKind::pulse});
  IdentificationSettings settings;
  settings.unknowns = parameters_named(beam, usual_keys(beam));
  settings.jitter = 1e-6;
  const Identification found = identify(beam, events, settings);
  EXPECT_EQ(found.problem, FitProblem::degenerate_orbit) << name_of(found.problem);
  for (const FittedUnknown& fitted : found.unknowns) EXPECT_FALSE(fitted.determined);
}

TEST(Explain, NamesSmallestExplainingSet) {
  const Scene scene = shipped_scene("paper_beam");
  const auto all = parameters_named(scene, usual_keys(scene));
  IdentificationSettings settings;
  settings.unknowns = all;
  const auto explained = [&](const std::vector<std::string>& keys, const Eigen::VectorXd& values) {
    const auto events = events_of(with(scene, parameters_named(scene, keys), values), 50.0);
    return explain(scene, events, settings, 0.0, identify(scene, events, settings));
  };
  const Explanations right = explained({}, {});
  ASSERT_EQ(right.simplest.size(), 1U);
  EXPECT_TRUE(right.simplest[0].keys.empty());
  const Explanations one = explained({"beam.damping"}, Eigen::VectorXd::Constant(1, 0.2));
  ASSERT_EQ(one.simplest.size(), 1U);
  EXPECT_EQ(one.simplest[0].keys, (std::vector<std::string>{"beam.damping"}));
  if (sanitized) return;
  const Explanations two =
      explained({"beam.bending_stiffness", "excitation.phase"}, Eigen::Vector2d(1.02, 0.3));
  ASSERT_EQ(two.simplest.size(), 1U);
  EXPECT_EQ(two.simplest[0].keys,
            (std::vector<std::string>{"beam.bending_stiffness", "excitation.phase"}));
}

}  // namespace
}  // namespace sprag
