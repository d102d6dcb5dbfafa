// Parts of a study: its file, the run of an index, random draws, figures of a run.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/study/design.h"
#include "sprag/detail/study/quantities.h"
#include "sprag/detail/study/random.h"
#include "sprag/detail/study/trial.h"
#include "sprag/energy.h"
#include "sprag/observer.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tests/support/temporary_directory.h"

namespace sprag::study {
namespace {

using test::read_text;
using test::write_text;

class StudyTest : public testing::Test {
 protected:
  Study read(const std::string& text, const std::string& scene = "lab_rig") {
    write_text(file(), "scene = \"" SPRAG_SOURCE_DIR "/scenes/" + scene + ".toml\"\n" + text);
    return read_study(file(), {});
  }

  /// The error message without the name of the file.
  std::string error(const std::string& text, const std::string& scene = "lab_rig") {
    try {
      read(text, scene);
    } catch (const SceneError& error) {
      const std::string what = error.what();
      const std::string place = file().string() + ":";
      EXPECT_TRUE(what.starts_with(place)) << what;
      return what.substr(std::min(place.size(), what.size()));
    }
    return "no error";
  }

  std::filesystem::path file() const { return directory_ / "study.toml"; }
  test::TemporaryDirectory directory_;
};

TEST(Philox, GivesTheKnownAnswers) {
  // kat_vectors of Random123, the authors' reference library.
  using Block = std::array<std::uint32_t, 4>;
  EXPECT_EQ(philox({}, {}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(philox({ones, ones, ones, ones}, {ones, ones}),
            (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(StudyRandom, IsNormalAndAStreamForEachRunAndPurpose) {
  constexpr int count = 100000;
  double sum = 0.0, squares = 0.0, fourth = 0.0;
  Random random(7, 12345678901, Purpose::jitter);
  for (int i = 0; i < count; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
  }
  // Within five standard deviations of the sample's moments.
  EXPECT_NEAR(sum / count, 0.0, 5.0 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 1.0, 5.0 * std::sqrt(2.0 / count));
  EXPECT_NEAR(fourth / count, 3.0, 5.0 * std::sqrt(96.0 / count));

  std::set<double> first;
  for (const std::uint64_t seed : {1, 2}) {
    for (const std::uint64_t run : {0U, 1U, 4294967295U}) {
      for (const Purpose purpose : {Purpose::jitter, Purpose::losses, Purpose::axes}) {
        first.insert(Random(seed, run, purpose).uniform());
        first.insert(Random(seed, run + (std::uint64_t{1} << 32U), purpose).uniform());
      }
    }
  }
  EXPECT_EQ(first.size(), 2U * 3U * 3U * 2U);
  EXPECT_EQ(Random(3, 4, Purpose::axes).normal(), Random(3, 4, Purpose::axes).normal());
}

TEST_F(StudyTest, GridIsAProductInTheOrderOfTheFile) {
  const Study study = read(R"(
runs = 3
[vary]
impact.restitution = [0.5, 0.6]
events.jitter = { log = [1e-6, 1e-2], points = 3 }
disturbance.lost = { linear = [0.0, 0.2], points = 3, zip = "trouble" }
contact.1.clearance = { relative = [-0.5, 0.5, 1.0], zip = "trouble" }
)");
  EXPECT_EQ(columns(study), (std::vector<std::string>{"index", "point", "run", "impact.restitution",
                                                      "events.jitter", "disturbance.lost",
                                                      "contact.1.clearance", "failure"}));
  ASSERT_EQ(study.points, 18);
  EXPECT_EQ(study.indices(), 54);
  const std::vector<double> clearances = {0.001, 0.003, 0.004};
  for (std::int64_t index = 0; index < study.indices(); ++index) {
    const std::int64_t point = index / 3;
    const std::vector<double> values = values_at(study, index);
    EXPECT_EQ(values[0], point < 9 ? 0.5 : 0.6);
    EXPECT_DOUBLE_EQ(values[1], std::pow(10.0, -6.0 + 2.0 * static_cast<double>(point / 3 % 3)));
    EXPECT_EQ(values[2], 0.1 * static_cast<double>(point % 3));
    EXPECT_DOUBLE_EQ(values[3], clearances[static_cast<std::size_t>(point % 3)]);
  }
  const Setting setting = setting_of(study, values_at(study, 53));
  EXPECT_EQ(setting.machine.model.contacts[0].restitution, 0.6);
  EXPECT_EQ(setting.machine.model.contacts[0].clearance, 0.004);
  EXPECT_EQ(setting.observer.prior.jitter, 1e-2);
  EXPECT_EQ(setting.disturbance.jitter, 1e-2);
  EXPECT_EQ(setting.disturbance.lost, 0.2);
}

TEST_F(StudyTest, RandomAxesAreDrawnForEachRun) {
  const std::string text = R"(
runs = 200
[vary]
impact.restitution = { linear = [0.2, 0.6], random = true }
contact.1.clearance = { log = [1e-4, 1e-2], random = true }
events.jitter = [1e-5, 1e-4]
)";
  const Study study = read(text);
  const Study common = read("draws = \"common\"\n" + text);
  std::set<double> drawn, drawn_in_common;
  int below = 0;
  for (std::int64_t index = 0; index < study.indices(); ++index) {
    const std::vector<double> values = values_at(study, index);
    EXPECT_GE(values[0], 0.2);
    EXPECT_LT(values[0], 0.6);
    EXPECT_GE(values[1], 1e-4);
    EXPECT_LT(values[1], 1e-2);
    if (values[1] < 1e-3) ++below;
    drawn.insert(values[0]);
    drawn_in_common.insert(values_at(common, index)[0]);
  }
  EXPECT_EQ(drawn.size(), 400U);
  EXPECT_EQ(drawn_in_common.size(), 200U);
  EXPECT_EQ(values_at(common, 17)[0], values_at(common, 217)[0]);
  EXPECT_NEAR(below, 200, 5 * 10);  // half of them, five standard deviations
}

TEST_F(StudyTest, ObserverKeyDoesNotChangeMachine) {
  const Study study = read(R"(
[vary]
impact.restitution = [0.5, 0.7]
observer.impact.restitution = { relative = [-0.1, 0.0] }
observer.system.K.1.1 = [1810.0]
system.K.1.2 = [-610.0]
)");
  const std::vector<double> values = values_at(study, 2);
  EXPECT_DOUBLE_EQ(values[1], 0.63);  // relative to the machine's varied value
  const Setting setting = setting_of(study, values);
  EXPECT_EQ(setting.machine.model.contacts[0].restitution, 0.7);
  EXPECT_DOUBLE_EQ(setting.observer.model.contacts[0].restitution, 0.63);
  EXPECT_EQ(setting.machine.model.K(1, 0), -610.0);
  EXPECT_EQ(setting.observer.model.K(0, 1), -610.0);
  EXPECT_EQ(setting.machine.model.K(0, 0), 1800.0);
  EXPECT_EQ(setting.observer.model.K(0, 0), 1810.0);
}

TEST_F(StudyTest, ErrorsNamePositionAndAllowedValues) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"runs = 0", "2:8: runs is 0; must be in 1..1000000000"},
      {"rnus = 1", "2:1: unknown key rnus; did you mean runs?"},
      {"draws = \"other\"", "2:9: draws is \"other\"; must be \"independent\" or \"common\""},
      {"estimators = [\"replika\"]",
       "2:15: estimators[1] is \"replika\"; did you mean \"replica\"?"},
      {"record = [\"impacts\", \"impacts\"]",
       "2:22: record[2] is \"impacts\" again; must be another one"},
      {"record = [\"impacts\"]", "1:1: missing key duration"},
      {"record = [\"V_floor\"]\nduration = 1.0",
       "2:10: record has quantities of an estimator; must go with estimators = [...]"},
      {"estimators = [\"replica\"]\nrecord = [\"nees\"]\nduration = 1.0",
       "3:10: record has nees, beyond_3_sigma or trusted, which a replica does not tell; must go "
       "with "
       "the estimator timing, both or adaptive"},
      {"estimators = [\"both\"]\nrecord = [\"worse\"]\nduration = 1.0",
       "3:10: record has worse, which is against the replica; must go with the estimators replica "
       "and timing, both or adaptive"},
      {"estimators = [\"adaptive\"]\nrecord = [\"V_floor\"]\nduration = 1.0\n[vary]\n"
       "observer.modes = [1]",
       "2:14: estimators has adaptive, which seeks keys of the scene; must be without it where "
       "observer.modes varies"},
      {"[machine]\ncoordinates = [\"q3\"]",
       "3:16: machine.coordinates[1] is \"q3\"; must be one of q1, q2, u1, u2"},
      {"[disturbance]\nlost = 1.5", "3:8: disturbance.lost is 1.5; must be in [0, 1]"},
      {"[vary]\nimpact.restituton = [0.5]",
       "3:21: vary.impact.restituton = 0.5: " SPRAG_SOURCE_DIR
       "/scenes/lab_rig.toml: unknown key impact.restituton; did you mean restitution?"},
      {"[vary]\nimpact.restitution = [0.5, 1.5]",
       "3:22: vary.impact.restitution = 1.5: " SPRAG_SOURCE_DIR
       "/scenes/lab_rig.toml: impact.restitution is 1.5; must be in [0, 1]"},
      {"[vary]\nimpact.restitution = { linaer = [0, 1], points = 3 }",
       "3:24: unknown key vary.impact.restitution.linaer; did you mean linear?"},
      {"[vary]\nimpact.restitution = { linear = [0, 1] }",
       "3:33: vary.impact.restitution.linear is a range; must go with points = n or random = true"},
      {"[vary]\nimpact.restitution = { linear = [0, 1, 2], points = 3 }",
       "3:33: vary.impact.restitution.linear has 3 numbers; must be a range of two, with points"},
      {"[vary]\nimpact.restitution = { log = [0, 1], points = 3 }",
       "3:30: vary.impact.restitution.log has 0; must be > 0"},
      {"[vary]\nimpact.restitution = \"high\"",
       "3:22: vary.impact.restitution has an entry that is no finite number; must be a number, an "
       "array of numbers, or a table such as { linear = [0, 1], points = 5 }"},
      {"[vary]\nevents.jitter = { relative = [-0.1, 0.1] }",
       "3:17: vary.events.jitter is relative; must be a number that " SPRAG_SOURCE_DIR
       "/scenes/lab_rig.toml gives"},
      {"[vary]\ndisturbance.jiter = [0.1]",
       "3:21: vary.disturbance.jiter is not known; did you mean disturbance.jitter?"},
      {"[vary]\ncontact.2.clearance = [0.1]",
       "3:23: vary.contact.2.clearance = 0.1: " SPRAG_SOURCE_DIR
       "/scenes/lab_rig.toml: has no contact.2.clearance"},
      {"[vary]\nobserver.modes = [1, 3]",
       "3:18: vary.observer.modes has 3; must be whole numbers in 1..2"},
      {"[vary]\nduration = { linear = [1, 2], points = 2, zip = \"a\" }\ntick = { linear = [0.1, "
       "0.2], "
       "points = 3, zip = \"a\" }",
       "4:8: vary.tick has 3 points; must have 2, as others of zip \"a\""}};
  for (const auto& [text, expected] : cases) EXPECT_EQ(error(text), expected) << text;
  EXPECT_EQ(error("[vary]\nobserver.beam.modes = [5]", "paper_beam"),
            "3:23: vary.observer.beam.modes = 5: the observer has more coordinates than the "
            "machine; must be as many at most");
}

TEST_F(StudyTest, StartsHaveTheirEnergyAndAreOutsideOfSupports) {
  for (const char* scene : {"lab_rig", "paper_beam", "three_ball_chain"}) {
    const Study study = read("[start]\nreplica = 0.3\nmachine = 1e-3\n", scene);
    const Setting fixed = setting_of(study, {});
    const ErrorEnergy energy(fixed.machine.model);
    std::set<double> starts;
    for (std::uint64_t run = 0; run < 20; ++run) {
      Setting setting = fixed;
      draw_starts(study, run, setting);
      const auto between = [&](const State& a, const State& b) {
        return energy(a.q, a.u, b.q, b.u)[0];
      };
      EXPECT_NEAR(between(setting.machine.truth.start, setting.observer.prior.start), 0.3, 1e-9)
          << scene;
      EXPECT_NEAR(between(setting.machine.truth.start, fixed.machine.truth.start), 1e-3, 1e-11)
          << scene;
      for (const Contact& contact : setting.machine.model.contacts) {
        EXPECT_GE(gap(contact, setting.machine.truth.start.q, 0.0), 0.0) << scene;
      }
      starts.insert(setting.machine.truth.start.u[0]);
    }
    EXPECT_EQ(starts.size(), 20U);
  }
}

std::vector<ContactEvent> events_of_rig() {
  const Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/lab_rig.toml");
  return simulate(scene.model, scene.truth.start, 100.0, 0.0).events;
}

TEST(StudyDisturbance, HasGivenSize) {
  const std::vector<ContactEvent> events = events_of_rig();
  ASSERT_GT(events.size(), 300U);
  EXPECT_EQ(disturb(events, {}, 1, 100.0, 1, 0), events);

  const auto jittered = disturb(events, {.jitter = 1e-4}, 1, 1e9, 1, 5);
  ASSERT_EQ(jittered.size(), events.size());
  double squares = 0.0;
  for (std::size_t i = 0; i < events.size(); ++i) {
    squares += std::pow((jittered[i].t - events[i].t) / 1e-4, 2);
  }
  const auto n = static_cast<double>(events.size());
  EXPECT_NEAR(squares / n, 1.0, 5.0 * std::sqrt(2.0 / n));
  const auto more = disturb(events, {.jitter = 2e-4, .lost = 0.0}, 1, 1e9, 1, 5);
  EXPECT_NEAR(more[7].t - events[7].t, 2.0 * (jittered[7].t - events[7].t), 1e-12);

  const auto with_loss = [&](double lost) { return disturb(events, {.lost = lost}, 1, 1e9, 1, 5); };
  const auto few = with_loss(0.4), many = with_loss(0.1);
  EXPECT_LT(few.size(), many.size());
  for (const ContactEvent& event : few) {
    EXPECT_NE(std::find(events.begin(), events.end(), event), events.end());
  }
  const auto pulses = disturb({}, {.spurious = 3.0}, 2, 100.0, 1, 5);
  EXPECT_NEAR(static_cast<double>(pulses.size()), 600.0, 5.0 * std::sqrt(600.0));
  for (std::size_t i = 1; i < pulses.size(); ++i) EXPECT_GE(pulses[i].t, pulses[i - 1].t);
}

TEST_F(StudyTest, FiguresMatchErrorsOfRun) {
  const Study study = read("[start]\nreplica = 0.5\n");
  Setting setting = setting_of(study, {});
  draw_starts(study, 0, setting);
  setting.observer.prior.uncertainty.setConstant(2, 0.25);
  const Truth truth = run_machine(setting.machine, 60.0, 0.0, 600);
  EXPECT_EQ(truth.samples(), 600);
  const auto figures = [&](EstimatorKind kind, double threshold) {
    return follow(kind, setting.observer, truth.events, truth, threshold);
  };
  const Figures replica = figures(EstimatorKind::replica, 0.05);
  EXPECT_LT(replica.V_floor, 1e-15);
  EXPECT_LE(replica.V_floor, replica.V_max);
  EXPECT_GT(replica.rate, 0.1);
  EXPECT_GT(replica.time_below, 0.0);
  EXPECT_LT(replica.time_below, figures(EstimatorKind::replica, 5e-4).time_below);
  EXPECT_TRUE(std::isnan(replica.trusted));
}

TEST(StudyFigures, MatchEstimatesOfObserver) {
  for (const char* name : {"lab_rig", "two_stops_beam"}) {
    Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/" + std::string(name) + ".toml");
    scene.prior.jitter = 1e-4;
    scene.prior.drift = 1e-6;
    const Eigen::Index f = scene.model.coordinates();
    const auto contacts = static_cast<int>(scene.model.contacts.size());
    const Truth truth = run_machine(scene, 20.0, 0.025, 160);
    ASSERT_EQ(truth.stride, 5);
    const auto events =
        disturb(truth.events, {.jitter = 1e-4, .spurious = 0.05}, contacts, 20.0, 2, 3);
    for (const EstimatorKind kind : {EstimatorKind::timing, EstimatorKind::both}) {
      const Figures figures = follow(kind, scene, events, truth, 0.0);
      const Estimates estimates = observe(scene, events, 20.0, {.tick = 0.025, .estimator = kind});
      const ErrorEnergy energy(scene.model);
      std::vector<double> V, squares;
      int of_filter = 0, beyond = 0;
      for (Eigen::Index i = 1; i <= 160; ++i) {
        const Eigen::Index k = 5 * i;
        of_filter += estimates.of_filter[static_cast<std::size_t>(k)];
        if (i <= 80) continue;
        V.push_back(energy(truth.q.col(i), truth.u.col(i), estimates.q.row(k).transpose(),
                           estimates.u.row(k).transpose())[0]);
        for (Eigen::Index j = 0; j < f; ++j) {
          for (const double z : {(estimates.q(k, j) - truth.q(j, i)) / estimates.sigma_q(k, j),
                                 (estimates.u(k, j) - truth.u(j, i)) / estimates.sigma_u(k, j)}) {
            if (!std::isfinite(estimates.sigma_q(k, j))) continue;
            squares.push_back(z * z);
            if (std::abs(z) > 3.0) ++beyond;
          }
        }
      }
      std::sort(V.begin(), V.end());
      EXPECT_EQ(figures.V_floor, 0.5 * (V[39] + V[40])) << name;
      EXPECT_EQ(figures.V_max, V.back()) << name;
      const auto count = static_cast<double>(squares.size());
      ASSERT_GT(count, 0.0);
      EXPECT_NEAR(figures.nees, std::accumulate(squares.begin(), squares.end(), 0.0) / count,
                  1e-9 * figures.nees);
      EXPECT_EQ(figures.beyond_3_sigma, beyond / count);
      EXPECT_EQ(figures.trusted, of_filter / 160.0);
    }
  }
}

TEST(StudyFigures, CountContactsThatAreClosedAtTheStart) {
  Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/bouncing_ball.toml");
  scene.truth.start = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)};
  scene.prior.start = {Eigen::VectorXd::Constant(1, 0.1), Eigen::VectorXd::Zero(1)};
  const Truth truth = run_machine(scene, 4.0, 0.0, 40);
  ASSERT_EQ(truth.events.size(), 1U);
  ASSERT_EQ(truth.events[0].t, 0.0);
  // The replica falls, and stays at rest where it lands.
  EXPECT_LT(follow(EstimatorKind::replica, scene, truth.events, truth, 0.0).V_max, 1e-20);
  EXPECT_GT(follow(EstimatorKind::replica, scene, {}, truth, 0.0).V_max, 1.0);
}

TEST(StudyFigures, CountSamplesFarAboveReplica) {
  const std::vector<EstimatorKind> kinds = {EstimatorKind::timing, EstimatorKind::replica,
                                            EstimatorKind::both};
  std::vector<Figures> figures(3);
  // Three samples of the transient and four settled ones; the rounding level is 1e-20 of 1.
  figures[0].V = {1.0, 5.0, 5.0, 5.0, 1.1e-5, 0.9e-5, 1e-20, 1.1e-20};
  figures[1].V = {1.0, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 0.0, 0.0};
  figures[2].V = figures[1].V;
  add_worse(kinds, figures);
  EXPECT_EQ(figures[0].worse, 0.5);
  EXPECT_EQ(figures[2].worse, 0.0);
  EXPECT_TRUE(std::isnan(figures[1].worse));
  std::vector<Figures> alone(1, figures[0]);
  alone[0].worse = std::numeric_limits<double>::quiet_NaN();
  add_worse(std::span(kinds).first(1), alone);
  EXPECT_TRUE(std::isnan(alone[0].worse)) << "there is no replica";
}

// Statement of docs/measurements/robustness.md on the paper's beam: if the filter alone diverges,
// both is not much worse than the replica.
TEST_F(StudyTest, BothIsNeverMuchWorseThanTheReplica) {
  const std::string common = R"(
duration = 120.0
runs = 6
estimators = ["replica", "both"]
record = ["V_floor", "worse"]
[start]
machine = 5e-3
[vary]
events.jitter = [1e-4]
)";
  for (const char* trouble :
       {"disturbance.lost = [0.05]", "disturbance.spurious = [0.1]",
        "observer.beam.bending_stiffness = [1.03]", "observer.contact.1.clearance = [0.01]"}) {
    const Study study = read(common + trouble + "\n", "paper_beam");
    std::vector<double> V, V_replica, worse;
    for (std::int64_t index = 0; index < study.runs; ++index) {
      Setting setting = setting_of(study, values_at(study, index));
      draw_starts(study, stream_of(study, index), setting);
      const Truth truth = run_machine(setting.machine, 120.0, 0.0, study.samples);
      const auto events =
          disturb(truth.events, setting.disturbance, 1, 120.0, study.seed, stream_of(study, index));
      std::vector<Figures> figures;
      for (const EstimatorKind kind : study.estimators)
        figures.push_back(follow(kind, setting.observer, events, truth, 0.0));
      add_worse(study.estimators, figures);
      V_replica.push_back(figures[0].V_floor);
      V.push_back(figures[1].V_floor);
      worse.push_back(figures[1].worse);
    }
    const auto middle = [](std::vector<double>& values) {
      std::sort(values.begin(), values.end());
      return values[values.size() / 2];
    };
    EXPECT_LE(middle(V), 10.0 * middle(V_replica)) << trouble;
    EXPECT_LE(std::accumulate(worse.begin(), worse.end(), 0.0) / 6.0, 0.05) << trouble;
  }
}

TEST_F(StudyTest, AdaptiveObserverIdentifiesWrongParameters) {
  const Study study = read(R"(
duration = 100.0
estimators = ["replica", "adaptive"]
record = ["V_floor", "trusted", "nees", "worse"]
[vary]
events.jitter = [1e-4]
observer.impact.restitution = { relative = [-0.1] }
)",
                           "paper_beam");
  EXPECT_EQ(columns(study),
            (std::vector<std::string>{"index", "point", "run", "events.jitter",
                                      "observer.impact.restitution", "replica.V_floor",
                                      "adaptive.V_floor", "adaptive.nees", "adaptive.trusted",
                                      "adaptive.worse", "failure"}));
  const Setting setting = setting_of(study, values_at(study, 0));
  const Truth truth = run_machine(setting.machine, 100.0, 0.0, 1000);
  const auto events = disturb(truth.events, setting.disturbance, 1, 100.0, 1, 0);
  const Figures replica = follow(EstimatorKind::replica, setting.observer, events, truth, 0.0);
  const Figures adaptive = follow(EstimatorKind::adaptive, setting.observer, events, truth, 0.0);
  EXPECT_LT(adaptive.V_floor, 1e-3 * replica.V_floor);
  EXPECT_GT(adaptive.trusted, 0.5);
  EXPECT_LT(adaptive.nees, 10.0);
}

TEST_F(StudyTest, AllModesGiveTheMachine) {
  const std::string common = R"(
duration = 20.0
estimators = ["replica"]
record = ["V_floor", "rate"]
[start]
replica = 0.1
)";
  const Study plain = read(common + "[vary]\nevents.jitter = 1e-4\n");
  const Study modal = read(common + "[vary]\nevents.jitter = 1e-4\nobserver.modes = [1, 2]\n");
  const auto figures = [](const Study& study, const std::vector<double>& values) {
    Setting setting = setting_of(study, values);
    draw_starts(study, 0, setting);
    const Truth truth = run_machine(setting.machine, study.duration, 0.0, 200);
    return follow(EstimatorKind::replica, setting.observer,
                  disturb(truth.events, setting.disturbance, 1, study.duration, 1, 0), truth, 0.0);
  };
  const double whole = figures(plain, {1e-4}).V_floor;
  EXPECT_NEAR(figures(modal, {1e-4, 2.0}).V_floor, whole, 0.5 * whole);
  EXPECT_GT(figures(modal, {1e-4, 1.0}).V_floor, 100.0 * whole);
}

}  // namespace
}  // namespace sprag::study
