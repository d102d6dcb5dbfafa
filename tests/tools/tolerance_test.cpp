// tolerance on other machines than the paper's beam: its limits are admissible and tight, follow
// the law of V, and do not depend on threads.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "sprag/detail/tolerance/search.h"
#include "sprag/reduction.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tools/tolerance/modes.h"
#include "tools/tolerance/print.h"
#include "tools/tolerance/words.h"

namespace sprag::tolerance {
namespace {

using test::Arguments;
using test::read_text;
using test::write_text;

Scene rig() { return read_scene(SPRAG_SOURCE_DIR "/scenes/lab_rig.toml"); }

Deviation named(const Bench& bench, const std::string& name) {
  for (const Deviation& deviation : deviations_of(bench.scene(), bench.closings_per_time()))
    if (deviation.name == name) return deviation;
  throw Error("no " + name);
}

double median_floor(const Bench& bench, const Deviation& deviation, double amount, std::size_t e) {
  std::vector<double> values;
  for (int run = 0; run < bench.settings().runs; ++run)
    values.push_back(bench.figures(&deviation, amount, run)[e].V_floor);
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

TEST(ToleranceAmounts, AreOneTwoAndFiveTimesPowersOfTen) {
  Deviation deviation;
  deviation.least = 2e-3;
  deviation.most = 1.0;
  EXPECT_EQ(amounts(deviation, false),
            (std::vector<double>{2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0}));
  EXPECT_EQ(amounts(deviation, true), (std::vector<double>{1e-2, 0.1, 1.0}));
}

TEST(ToleranceAmounts, ArePrintedInUnits) {
  Deviation time;
  EXPECT_EQ(amount_text(time, 3.4e-4), "0.34 ms");
  EXPECT_EQ(amount_text(time, 2e-6), "2 us");
  EXPECT_EQ(amount_text(time, 0.25), "0.25 s");
  Deviation phase{Deviation::Kind::parameter, "excitation.phase", "rad"};
  EXPECT_EQ(in_words(phase, 0.034), "excitation.phase to 0.034 rad");
  phase.share = true;
  EXPECT_EQ(amount_text(phase, 0.034), "3.4 %");
  EXPECT_EQ(limit_text(time, {Limit::Kind::beyond_all, 0.5}), "> 0.5 s");
  EXPECT_EQ(limit_text(time, {Limit::Kind::below_all, 1e-3}), "< 1 ms");
  EXPECT_EQ(limit_text(time, {Limit::Kind::never, 0.0}), "-");
}

TEST(WrongParameter, IsChangedByAmountAndStaysValid) {
  const Scene scene = rig();
  const Bench bench(scene, {.duration = 10.0, .runs = 1}, 1);
  const Deviation epsilon = named(bench, "impact.restitution");
  EXPECT_TRUE(epsilon.share);
  const auto restitution = [&](double amount, bool other_way) {
    return with_wrong_parameter(scene, epsilon, amount, other_way).model.contacts[0].restitution;
  };
  EXPECT_DOUBLE_EQ(restitution(0.1, false), 0.66);
  EXPECT_DOUBLE_EQ(restitution(0.1, true), 0.54);
  EXPECT_DOUBLE_EQ(restitution(0.8, false), 0.12) << "1.08 is none: off the other way";
  const Deviation stiffness = named(bench, "system.K");
  EXPECT_LT(
      (with_wrong_parameter(scene, stiffness, 0.2, true).model.K - 0.8 * scene.model.K).norm(),
      1e-9);
}

// V of a replica is quadratic in the deviation, so that four times the target admits twice the
// deviation. Both ends of the bracket are checked by new runs.
TEST(Tolerance, LimitsAreToleratedAndScaleLikeRootOfV) {
  const Settings settings{.target = 1e-6, .runs = 5, .estimators = {EstimatorKind::replica}};
  Settings wider = settings;
  wider.target = 4e-6;
  const Bench bench(rig(), settings, 2), wide(rig(), wider, 2);
  for (const char* name : {"jitter", "impact.restitution", "system.K"}) {
    const Deviation deviation = named(bench, name);
    const auto limit = [&](const Bench& of) {
      return search(of, {deviation}, 2, [](int, double) {}).found.front().limits.front();
    };
    const Limit narrow = limit(bench), twice = limit(wide);
    ASSERT_EQ(narrow.kind, Limit::Kind::within) << name;
    ASSERT_EQ(twice.kind, Limit::Kind::within) << name;
    EXPECT_NEAR(twice.amount / narrow.amount, 2.0, 0.5) << name;
    EXPECT_LT(median_floor(bench, deviation, 0.7 * narrow.amount, 0), 1e-6) << name;
    EXPECT_GT(median_floor(bench, deviation, 1.4 * narrow.amount, 0), 1e-6) << name;
  }
}

TEST(Tolerance, DoesNotDependOnThreads) {
  const Settings settings{.duration = 20.0, .runs = 3};
  std::string csv;
  for (const int threads : {1, 3}) {
    const Bench bench(rig(), settings, threads);
    const Tolerances found = search(bench, {named(bench, "lost"), named(bench, "spurious")},
                                    threads, [](int, double) {});
    if (csv.empty()) csv = to_csv(bench, found);
    EXPECT_EQ(csv, to_csv(bench, found));
  }
}

// A ball that bounces without loss does not converge to its machine: there is no limit.
TEST(Tolerance, ReportsMissingLimit) {
  Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/bouncing_ball.toml");
  for (Contact& contact : scene.model.contacts) contact.restitution = 1.0;
  const Bench bench(scene, {.duration = 20.0, .runs = 2, .estimators = {EstimatorKind::replica}},
                    1);
  const Tolerances found = search(bench, {named(bench, "jitter")}, 1, [](int, double) {});
  EXPECT_EQ(found.found.front().limits.front().kind, Limit::Kind::never);
  EXPECT_NE(to_text(bench, found).find("even where nothing is off"), std::string::npos);
}

TEST(Tolerance, DriftIsGivenToFiltersOnly) {
  const Settings settings{.duration = 20.0,
                          .jitter = 1e-4,
                          .runs = 1,
                          .estimators = {EstimatorKind::replica, EstimatorKind::timing}};
  Settings drifting = settings;
  drifting.drift = 1e-3;
  const Bench plain(rig(), settings, 1), with_drift(rig(), drifting, 1);
  const auto before = plain.figures(nullptr, 0.0, 0), after = with_drift.figures(nullptr, 0.0, 0);
  EXPECT_EQ(after[0].V_floor, before[0].V_floor);
  EXPECT_LT(after[1].nees, 0.5 * before[1].nees);
}

TEST(Tolerance, AdaptiveObserverToleratesParametersItIdentifies) {
  const Bench bench(read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml"),
                    {.duration = 100.0,
                     .jitter = 1e-4,
                     .runs = 1,
                     .estimators = {EstimatorKind::replica, EstimatorKind::adaptive}},
                    1);
  const Deviation stiffness = named(bench, "beam.bending_stiffness");
  const auto figures = bench.figures(&stiffness, 0.05, 0);
  EXPECT_LT(figures[1].V_floor, 1e-3 * figures[0].V_floor);
  EXPECT_EQ(figures[1].worse, 0.0);
}

// The rig has two modes, so that one mode and the static vector of its contact represent the whole
// machine.
TEST(FewerModes, AllModesAreExactAndCorrectionReplacesOmittedOnes) {
  const Bench bench(in_modes(rig(), 0),
                    {.runs = 2, .estimators = {EstimatorKind::replica, EstimatorKind::both}}, 2);
  const std::vector<FewerModes> table = fewer_modes(bench, 2, [](double) {});
  ASSERT_EQ(table.size(), 2u);
  const double motion = observed_motion(bench);
  for (std::size_t e = 0; e < 2; ++e) {
    EXPECT_GT(table[0].plain[e].median, 0.1 * motion);
    EXPECT_LT(table[0].corrected[e].median, 1e-9 * motion);
    EXPECT_LT(table[1].plain[e].median, 1e-9 * motion);
  }
  EXPECT_EQ(table[0].coordinates, 2);
  EXPECT_TRUE(table[1].corrected.empty());
}

class ToleranceProgramTest : public test::ProgramTest {};

TEST_F(ToleranceProgramTest, WritesATableItsRowsAndAPicture) {
  const auto ended =
      run(TOLERANCE, {SPRAG_SOURCE_DIR "/scenes/lab_rig.toml", "--target", "1e-5", "--runs", "2",
                      "--duration", "20", "--estimator", "replica", "--csv", path("t.csv"),
                      "--output", path("t.svg"), "--report", path("r.json")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("event times to"), std::string::npos) << ended.out;
  EXPECT_TRUE(
      read_text(path("t.csv")).starts_with("what,unit,amount,estimator,median,low,high,worse\n"));
  EXPECT_NE(read_text(path("t.svg")).find("</svg>"), std::string::npos);
  const auto report = nlohmann::json::parse(read_text(path("r.json")));
  EXPECT_EQ(report.at("target"), 1e-5);
  const auto& first = report.at("disturbances").at(0);
  EXPECT_EQ(first.at("what"), "jitter");
  EXPECT_EQ(first.at("tolerance").at("replica").at("kind"), "within");
  EXPECT_GT(first.at("tolerance").at("replica").at("amount"), 0.0);
}

// A scene's name is text with any content, as is the name of the picture.
TEST_F(ToleranceProgramTest, NamesAreData) {
  std::string text = read_text(SPRAG_SOURCE_DIR "/scenes/lab_rig.toml");
  const std::string good = "name = \"lab_rig\"";
  ASSERT_NE(text.find(good), std::string::npos);
  const std::string command = "touch " + path("ran");
  text.replace(
      text.find(good), good.size(),
      "name = " + nlohmann::json("a'\n!" + command + "\nsystem('" + command + "')").dump());
  const std::string scene = write_text(path("rig.toml"), text);
  const auto ended =
      run("/bin/sh", {"-c", "cd \"$1\" && shift && exec \"$@\"", "sh", path(""), TOLERANCE, scene,
                      "--runs", "1", "--duration", "10", "--estimator", "replica", "--output",
                      "|touch ran; cat > x.svg"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(read_text(path("|touch ran; cat > x.svg")).find("a'\\n!touch"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(path("ran")));
}

TEST_F(ToleranceProgramTest, AFullDiskIsAFailure) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  for (const char* name : {"t.csv", "t.svg"}) {
    std::filesystem::create_symlink("/dev/full", path(name));
    const auto ended =
        run(TOLERANCE, {SPRAG_SOURCE_DIR "/scenes/lab_rig.toml", "--runs", "1", "--duration", "10",
                        "--estimator", "replica",
                        std::string(name) == "t.csv" ? "--csv" : "--output", path(name)});
    EXPECT_EQ(ended.code, 1) << name;
    EXPECT_NE(ended.err.find(path(name) + ": No space left on device"), std::string::npos)
        << ended.err;
  }
}

TEST_F(ToleranceProgramTest, RefusesUnsupportedInput) {
  const std::string scene = SPRAG_SOURCE_DIR "/scenes/lab_rig.toml";
  const auto refuses = [&](const Arguments& arguments, const std::string& why) {
    const auto ended = run(TOLERANCE, arguments);
    EXPECT_EQ(ended.code, 2) << ended.out;
    EXPECT_NE(ended.err.find(why), std::string::npos) << ended.err;
  };
  refuses({scene, "--estimator", "kalman"}, "kalman; choose replica, timing, both or adaptive");
  refuses({scene, "--estimator", "adaptive", "--modes"}, "--modes: adaptive");
  refuses({SPRAG_SOURCE_DIR "/scenes/non_proportional.toml", "--estimator", "adaptive"},
          "couples the modes");
  refuses({scene, "--output", path("t.gif")}, "must end in .png, .svg or .pdf");
  refuses({scene, "--csv", path("x.csv"), "--output", path("x.csv")}, "x.csv");
  refuses({scene, "--target", "-1"}, "--target");
  const std::string copy = write_text(path("rig.toml"), read_text(scene));
  refuses({copy, "--csv", copy}, "rig.toml");
  EXPECT_EQ(read_text(copy), read_text(scene));
}

}  // namespace
}  // namespace sprag::tolerance
