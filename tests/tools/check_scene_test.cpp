// Would catch a verdict that does not follow from the machine: a false alarm on shipped scenes, an
// unreported violation of an assumption, wrong figures.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tools/check_scene/json.h"

namespace sprag {
namespace {

using std::numbers::ln10;
using Ids = std::vector<std::string>;

std::string shipped(const std::string& name) {
  return SPRAG_SOURCE_DIR "/scenes/" + name + ".toml";
}

const Finding& finding(const Assessment& assessment, const std::string& id) {
  for (const Finding& candidate : assessment.findings) {
    if (candidate.id == id) return candidate;
  }
  throw std::out_of_range("no finding " + id);
}

/// The required findings that are not met.
Ids broken(const Assessment& assessment) {
  Ids ids;
  for (const Finding& f : assessment.findings) {
    if (!f.required || f.holds) continue;
    ids.push_back(f.id);
    EXPECT_FALSE(f.change.empty()) << f.id;
  }
  EXPECT_EQ(assessment.synchronizes(), ids.empty());
  return ids;
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

Contact contact(const Eigen::VectorXd& w, double restitution, double clearance = 0.0) {
  return {.w = w, .clearance = clearance, .motion = {}, .restitution = restitution};
}

/// Two coordinates and two contacts with the cosine -0.8 between their directions; the second
/// contact is out of reach.
Scene two_contacts(ImpactLaw law, double epsilon_1, double epsilon_2) {
  Scene scene;
  scene.name = "two";
  Model& model = scene.model;
  model.M = model.C = model.K = Eigen::Matrix2d::Identity();
  model.K(1, 1) = 2.0;
  model.law = law;
  model.contacts = {contact(Eigen::Vector2d(1.0, 0.0), epsilon_1, 0.1),
                    contact(Eigen::Vector2d(-0.8, 0.6), epsilon_2, 3.0)};
  model.forces.push_back({Eigen::Vector2d(1.0, 0.4), 0.0, {2.0, 1.3, 0.0}});
  model.forces.push_back({Eigen::Vector2d(0.0, 1.0), 0.0, {1.0, 0.7, 0.0}});
  scene.truth.start = scene.prior.start = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  return scene;
}

/// One mass on a spring above a stop.
Scene one_mass(double C, double K, double force) {
  Scene scene;
  Model& model = scene.model;
  model.M = Eigen::MatrixXd::Constant(1, 1, 1.0);
  model.C = Eigen::MatrixXd::Constant(1, 1, C);
  model.K = Eigen::MatrixXd::Constant(1, 1, K);
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  model.contacts = {contact(one, 0.5)};
  model.forces.push_back({one, force, {}});
  scene.truth.start = scene.prior.start = {0.5 * one, 0.0 * one};
  return scene;
}

struct Shipped {
  const char* name;
  Ids broken;
  double decades, omega_max, closings_per_time;
  double spread = 0.1;  // of the rate, as a share: of 50 chaotic runs from starts 1e-9 apart
  std::array<double, 2> share = {0.0, 0.005};  // of the time that contact 1 is closed, from and to
};

/// Of the bouncing ball, which comes to rest after 2 sqrt(2 h/g) (1 + e) / (1 - e) / 2.
const double ball_rests = 1.0 - std::sqrt(2.0 * 0.9 / 9.81) * 1.9 / 0.1 / 100.0;

class ShippedScenes : public testing::TestWithParam<Shipped> {};
INSTANTIATE_TEST_SUITE_P(
    CheckScene, ShippedScenes,
    testing::Values(Shipped{"paper_beam", {}, 0.0738301, 61.6972, 1.6},
                    Shipped{"paper_beam_chatter", {}, 0.0738301, 61.6972, 8.6, 0.1, {0.005, 0.03}},
                    Shipped{"stiff_beam", {}, 0.0738301, 3752.917, 27.0},
                    Shipped{"bouncing_ball",
                            {"C", "K", "A1"},
                            0.0,
                            0.0,
                            1.97,
                            0.1,
                            {ball_rests - 1e-6, ball_rests + 1e-6}}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

TEST_P(ShippedScenes, HaveTheirVerdict) {
  const Shipped& expected = GetParam();
  const Assessment a = assess(read_scene(shipped(expected.name)));
  EXPECT_EQ(a.scene, expected.name);
  EXPECT_EQ(broken(a), expected.broken);
  EXPECT_NEAR(a.decades, expected.decades, 1e-7);
  EXPECT_NEAR(a.omega_max, expected.omega_max, 1e-5 * expected.omega_max);
  EXPECT_EQ(a.W.condition, 1.0);
  EXPECT_EQ(a.path, FlowPath::diagonal);
  // Chaotic, so that the rate varies between computers.
  EXPECT_NEAR(a.trial.closings_per_time(), expected.closings_per_time,
              expected.spread * expected.closings_per_time);
  EXPECT_EQ(a.trial.duration, a.trial.planned);
  EXPECT_TRUE(std::ranges::none_of(a.findings, [](const Finding& f) { return f.id == "bursts"; }));
  EXPECT_GE(a.trial.contacts[0].share, expected.share[0]);
  EXPECT_LE(a.trial.contacts[0].share, expected.share[1]);
  EXPECT_EQ(a.trial.contacts[0].last_share == 1.0, expected.share[0] > 0.5) << "at rest";
}

// The whole finite-element model, and the same beam with its first three modes.
TEST(CheckScene, BurstsOfAStiffStructureAreReported) {
  const test::TemporaryDirectory directory;
  const std::string rig = (directory / "rig").string();
  test::Process writes({SPRAG_SOURCE_DIR "/scripts/cantilever", rig, "10"}, directory / "", "rig");
  ASSERT_EQ(writes.wait(std::chrono::seconds(60)), 0) << writes.err();
  const auto scene = [&](const std::string& modes) {
    return read_scene(test::write_text(directory / "rig" / ("scene" + modes + ".toml"), R"(
[system]
M = "M.csv"
K = "K.csv"
damping_ratio = 0.02
)" + modes + R"(
[excitation]
influence = "shaking.csv"
amplitude = 0.03
frequency = 9.5
[[contact]]
direction = "stop.csv"
[impact]
restitution = 0.7
[master]
q = "start.csv"
[replica]
uncertainty = 0.5
)"));
  };
  const Assessment whole = assess(scene(""));
  const Finding bursts = finding(whole, "bursts");
  EXPECT_FALSE(bursts.required || bursts.holds);
  EXPECT_TRUE(says(bursts.what, "contact 1 closes ")) << bursts.what;
  EXPECT_TRUE(says(bursts.what, "times per period of the slowest mode (omega 3.516)"))
      << bursts.what;
  EXPECT_TRUE(says(bursts.change, "sustained contact")) << bursts.change;
  const Assessment three = assess(scene("modes = 3"));
  EXPECT_THROW(finding(three, "bursts"), std::out_of_range);
}

TEST(CheckScene, PaperBeamReportsModeAtNode) {
  const Assessment a = assess(read_scene(shipped("paper_beam")));
  ASSERT_EQ(a.modes.size(), 3U);
  EXPECT_NEAR(a.modes[0].projection, -1.6369, 1e-4);
  EXPECT_NEAR(a.modes[2].projection, -0.00436, 1e-6);
  EXPECT_NEAR(a.modes[2].seen, 0.00436 / 1.6369, 1e-6);
  EXPECT_NEAR(a.modes[2].decades, 0.17 / ln10, 1e-12);
  EXPECT_FALSE(a.modes[0].barely_seen() || a.modes[1].barely_seen());
  EXPECT_TRUE(a.modes[2].barely_seen());
  const Finding seen = finding(a, "seen_modes");
  EXPECT_FALSE(seen.holds || seen.required);
  EXPECT_TRUE(says(seen.what, "mode 3 (omega 61.7, w^T phi = -0.00436, 0.07383 decades"))
      << seen.what;
  EXPECT_FALSE(says(seen.what, "mode 2"));
  EXPECT_EQ(a.trial.contacts[0].share, 0.0);
}

TEST(CheckScene, ConditionOfTwoContactsByHand) {
  Scene scene = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  EXPECT_NEAR(assess(scene).W.condition, 3.0, 1e-12);  // sqrt(1.8 / 0.2)
  scene.model.contacts[1].w *= 10.0;
  Assessment a = assess(scene);
  EXPECT_NEAR(a.W.condition, 3.0, 1e-12);
  EXPECT_EQ(a.W.rank, 2);
  EXPECT_EQ(broken(a), Ids{});
  scene.model.M(0, 0) = 4.0;  // cosine -0.4 / sqrt(0.52)
  const double cosine = 0.4 / std::sqrt(0.52);
  EXPECT_NEAR(assess(scene).W.condition, std::sqrt((1 + cosine) / (1 - cosine)), 1e-12);
}

TEST(CheckScene, DependentDirectionsAreReported) {
  Scene scene = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  scene.model.contacts.push_back(contact(Eigen::Vector2d(-2.0, 0.0), 0.5, 0.3));
  const Assessment a = assess(scene);
  EXPECT_EQ(broken(a), Ids{});
  EXPECT_EQ(a.W.rank, 2);
  EXPECT_EQ(a.W.dependent, (std::vector<int>{0, 2}));
  EXPECT_TRUE(std::isinf(a.W.condition));
  EXPECT_TRUE(says(finding(a, "W").what, "contacts 1 and 3 are")) << finding(a, "W").what;
  nlohmann::ordered_json object;
  write_json(a, object);
  EXPECT_TRUE(test::parse_json(object.dump())["W"]["condition"].is_null());
}

/// A shaken mass on a spring between two stops, with a total clearance `room`.
Scene between_stops(double room, const Harmonic& motion = {}) {
  Scene scene;
  scene.name = "between";
  Model& model = scene.model;
  model.M = model.C = model.K = Eigen::MatrixXd::Identity(1, 1);
  model.C *= 0.2;
  model.contacts = {contact(Eigen::VectorXd::Ones(1), 0.5, 0.4 * room),
                    contact(Eigen::VectorXd::Constant(1, -3.0), 0.5, 3.0 * 0.6 * room)};
  model.contacts[1].motion = motion;
  model.forces.push_back({Eigen::VectorXd::Ones(1), 0.0, {2.0, 1.3, 0.0}});
  scene.truth.start = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1)};
  scene.prior.start = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1)};
  return scene;
}

// Eq. (17): W need not have full rank if time windows with all contacts open recur.
TEST(CheckScene, OpposingStopsPassIfAllContactsOpenRepeatedly) {
  const Assessment a = assess(between_stops(0.5));
  EXPECT_EQ(a.W.rank, 1);
  EXPECT_EQ(broken(a), Ids{});
  ASSERT_EQ(a.opposing.size(), 1U);
  EXPECT_NEAR(a.opposing[0].room, 3.0 * 0.5, 1e-12);
  EXPECT_GT(a.trial.longest_open, 0.0);
  EXPECT_GT(a.trial.open_share, 0.5);
  EXPECT_LE(a.trial.open_share, 1.0);
  const Finding W = finding(a, "W");
  EXPECT_TRUE(W.what.starts_with("provided that time windows in which all contacts are open recur"))
      << W.what;
  EXPECT_TRUE(says(W.what, "at least 1.5 between them: they cannot close together")) << W.what;
  const std::string text = to_text(a);
  EXPECT_TRUE(text.starts_with("between: will synchronize, provided that time windows")) << text;
  EXPECT_TRUE(says(text,
                   "\nyes, provided that time windows in which all contacts are open recur: "
                   "the default estimator, both:"))
      << text;
  nlohmann::ordered_json object;
  write_json(a, object);
  EXPECT_EQ(object["synchronizes"], true);
  EXPECT_EQ(object["default_estimator"]["provided"][0], W.provided);
  EXPECT_EQ(object["W"]["opposing_stops"][0]["contacts"], (std::vector<int>{1, 2}));
}

// Two contacts that cannot close together have only impacts of a single contact.
TEST(CheckScene, LawDoesNotMatterWithoutSimultaneousImpacts) {
  Scene scene = between_stops(0.5);
  scene.model.law = ImpactLaw::newton;
  scene.model.contacts[0].restitution = 0.9;
  scene.model.contacts[1].restitution = 0.2;
  EXPECT_EQ(broken(assess(scene)), Ids{});
  scene.model.contacts[1].motion = {2.0, 1.0, 0.0};  // at times no room
  const Assessment squeezed = assess(scene);
  EXPECT_FALSE(finding(squeezed, "clutches").holds);
  EXPECT_FALSE(squeezed.synchronizes());
}

TEST(CheckScene, RoomOfOpposingStopsAccountsForTheirMotion) {
  EXPECT_NEAR(opposing_stops(between_stops(0.5, {0.3, 2.0, 0.0}).model).at(0).room, 1.2, 1e-12);
  Model both = between_stops(0.5, {0.3, 2.0, 1.0}).model;
  both.contacts[0].motion = {0.1, 2.0, 1.0};  // g_2 + 3 g_1
  EXPECT_NEAR(opposing_stops(both).at(0).room, 1.5 - 0.6, 1e-12);
  both.contacts[1].motion.phase += std::numbers::pi;
  EXPECT_NEAR(opposing_stops(both).at(0).room, 1.5, 1e-12);
  both.contacts[1].motion.frequency = 3.0;
  EXPECT_NEAR(opposing_stops(both).at(0).room, 1.5 - 0.6, 1e-12);
  both.contacts[1].w *= -1.0;
  EXPECT_TRUE(opposing_stops(both).empty());
}

struct Verdict {
  const char* machine;
  Scene scene;
  Ids broken;
  const char *id, *what;  // of a finding
};

TEST(CheckScene, MachinesHaveTheirVerdicts) {
  const auto two = [](auto change) {
    Scene scene = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
    change(scene.model);
    return scene;
  };
  Scene pressed = between_stops(0.5);
  pressed.model.forces = {{Eigen::VectorXd::Ones(1), -3.0, {}}};
  Scene doubled = one_mass(1.0, 1.0, -2.0);
  doubled.model.contacts.push_back(doubled.model.contacts[0]);  // both close at one instant
  Scene one = two_contacts(ImpactLaw::newton, 0.5, 0.5);
  one.model.contacts.pop_back();
  Scene far = one_mass(1.0, 1.0, -1.0);
  far.model.contacts[0].clearance = 10.0;
  for (const Verdict& of : std::initializer_list<Verdict>{
           {"undamped", two([](Model& model) { model.C.setZero(); }), {"C"}, "C", "never decays"},
           {"rigid motion",
            two([](Model& model) { model.K << 3.0, -3.0, -3.0, 3.0; }),
            {"K"},
            "K",
            "q = (0.7071, 0.7071)"},
           {"indefinite mass", two([](Model& model) { model.M(1, 1) = -1.0; }), {"M"}, "M", ""},
           {"Newton, two contacts",
            two([](Model& model) { model.law = ImpactLaw::newton; }),
            {"clutches"},
            "clutches",
            ""},
           {"Newton, one contact", one, {}, "clutches", ""},
           {"free", one_mass(0.1, 0.0, 1.0), {"K", "A2"}, "A2", ""},
           {"free and undamped", one_mass(0.0, 0.0, 1.0), {"C", "K", "A2"}, "A2", ""},
           {"out of reach", far, {}, "trial", "never closed: contact 1"},
           {"pressed by two stops",
            pressed,
            {"W", "A1"},
            "W",
            "the trial ends without such a window"},
           {"one contact twice", doubled, {"W", "trial"}, "trial", "dependent"}}) {
    SCOPED_TRACE(of.machine);
    const Assessment a = assess(of.scene);
    EXPECT_EQ(broken(a), of.broken);
    EXPECT_TRUE(says(finding(a, of.id).what, of.what)) << finding(a, of.id).what;
    EXPECT_EQ(a.C.smallest == 0.0, finding(a, "C").holds == false);
    EXPECT_EQ(a.K.smallest == 0.0, finding(a, "K").holds == false);
    EXPECT_EQ(says(to_text(a), "may not synchronize"), !of.broken.empty());
  }
}

// The first lines are about the default estimator, whether Theorem 1 holds or not.
TEST(CheckScene, TheHeadlineIsAboutTheDefaultEstimator) {
  const std::string ball = to_text(assess(read_scene(shipped("bouncing_ball"))));
  EXPECT_TRUE(ball.starts_with(
      "bouncing_ball: will follow the machine, without the promise of Theorem 1\nyes: "
      "the default estimator, both: its filter knows the motion from t = "))
      << ball;
  EXPECT_TRUE(says(ball, "Theorem 1, for --estimator replica: may not synchronize\n")) << ball;
  std::istringstream lines(ball);
  int changes = 0;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 100U) << line;
    if (says(line, "-> ")) ++changes;
  }
  EXPECT_EQ(changes, 3);
  const std::string beam = headline(assess(read_scene(shipped("paper_beam"))));
  EXPECT_TRUE(beam.starts_with("will synchronize\nyes: the default estimator, both: ")) << beam;
  EXPECT_FALSE(says(beam, "Never closed")) << beam;

  Scene idle = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  EXPECT_TRUE(says(headline(assess(idle)), "Never closed in the trial: contact 2"));
  idle.model.C.setZero();
  for (Contact& each : idle.model.contacts) each.clearance = 100.0;
  const std::string lost = headline(assess(idle));
  EXPECT_TRUE(lost.starts_with("may not synchronize\nno: the default estimator, both: ")) << lost;
  EXPECT_TRUE(says(lost, "Never closed in the trial: contacts 1, 2")) << lost;
}

TEST(CheckScene, DampingByCouplingIsReported) {
  Scene scene = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  scene.model.C = Eigen::Vector2d(0.4, 0.0).asDiagonal();
  scene.model.K << 2.0, -1.0, -1.0, 2.0;
  const Assessment a = assess(scene);
  EXPECT_EQ(broken(a), Ids{"C"});
  EXPECT_EQ(a.path, FlowPath::dense);
  EXPECT_TRUE(says(finding(a, "C").what, "q = (0, 1)")) << finding(a, "C").what;
  EXPECT_TRUE(says(finding(a, "C").what, "every free motion decays")) << finding(a, "C").what;

  MatrixR A = MatrixR::Zero(4, 4);
  A.topRightCorner<2, 2>().setIdentity();
  A.bottomLeftCorner<2, 2>() = -scene.model.K.cast<Extended>();
  A.bottomRightCorner<2, 2>() = -scene.model.C.cast<Extended>();
  const auto slowest = static_cast<double>(general_eigenvalues(A).real().maxCoeff());
  EXPECT_NEAR(a.slow_root, slowest, 1e-13);
  EXPECT_NEAR(a.decades, -2 * slowest / ln10, 1e-13);
}

TEST(CheckScene, OverdampedMotionsDecayByTheirSlowRoot) {
  const Assessment a = assess(one_mass(5.0, 4.0, 0.0));  // s = -1, -4
  EXPECT_NEAR(a.slow_root, -1.0, 1e-15);
  EXPECT_NEAR(a.decades, 2 / ln10, 1e-15);
  EXPECT_NEAR(a.modes[0].decades, 2 / ln10, 1e-15);
  EXPECT_EQ(slow_root(1.0, 1.0), -1.0);
  EXPECT_EQ(slow_root(0.5, 1e-20), -1e-20);  // no cancellation
}

// G = [[1, -0.8], [-0.8, 1]]: eigenvalues of 2 x 2 matrices by hand.
TEST(CheckScene, UnlikeRestitutionIsJudgedByTheCriterion) {
  const double d_1 = 0.3 / 1.7, d_2 = 0.5 / 1.5, e_1 = 0.1 / 1.9, e_2 = 0.8 / 1.2;
  const auto exact = [](double a, double b) { return a + b - std::hypot(a - b, 0.8 * (a + b)); };
  const struct {
    ImpactLaw law;
    double epsilon_1, epsilon_2;
    Ids broken;
    double margin;
    const char* what;
  } cases[] = {{ImpactLaw::poisson, 0.7, 0.5, {}, 0.63 - std::hypot(0.12, 0.52), "sampling"},
               {ImpactLaw::newton, 0.7, 0.5, {"clutches"}, exact(d_1, d_2), "exact"},
               {ImpactLaw::poisson, 0.9, 0.2, {"A3"}, 0.575 - std::hypot(0.385, 0.656), "sampling"},
               {ImpactLaw::newton, 0.9, 0.2, {"A3", "clutches"}, exact(e_1, e_2), ""}};
  for (const auto& of : cases) {
    SCOPED_TRACE(of.margin);
    Scene scene = two_contacts(of.law, of.epsilon_1, of.epsilon_2);
    const Assessment a = assess(scene);
    EXPECT_EQ(broken(a), of.broken);
    EXPECT_FALSE(a.monotonicity.common);
    EXPECT_NEAR(a.monotonicity.margin, of.margin, 1e-12);
    EXPECT_TRUE(says(finding(a, "A3").what, of.what));
    EXPECT_EQ(finding(a, "A3").change.empty(), of.broken == Ids{"clutches"});
    scene.model.contacts[0].w *= 7.0;  // the unit of a gap is arbitrary
    EXPECT_NEAR(assess(scene).monotonicity.margin, of.margin, 1e-12);
  }
}

TEST(CheckScene, PermanentContactViolatesA1) {
  Scene scene = one_mass(1.0, 1.0, -1.0);
  const Assessment pressed = assess(scene);
  EXPECT_EQ(broken(pressed), Ids{"A1"});
  EXPECT_TRUE(says(finding(pressed, "A1").what, "contact 1 is closed throughout"));
  scene.model.forces[0].harmonic = {1.5, 0.5, 0.0};  // opens it repeatedly
  const Assessment shaken = assess(scene);
  EXPECT_EQ(broken(shaken), Ids{});
  EXPECT_GT(shaken.trial.contacts[0].last_share, 0.1);
}

TEST(CheckScene, ModesOfEqualFrequencyAreDistinguishedByContacts) {
  Scene scene = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  scene.model.contacts = {contact(Eigen::Vector2d(1.0, 1.0), 0.5, 0.1)};
  for (const bool repeated : {true, false}) {
    scene.model.K = Eigen::Matrix2d::Identity();
    if (!repeated) scene.model.K << 2.0, -1.0, -1.0, 2.0;
    const std::vector<Mode> seen = modes(Dynamics(scene.model));
    ASSERT_EQ(seen.size(), 2U);
    EXPECT_NEAR(std::abs(seen[0].projection), std::sqrt(2.0), 1e-14) << repeated;
    EXPECT_FALSE(seen[0].barely_seen());
    EXPECT_LT(seen[1].seen, 1e-14) << repeated;
    EXPECT_NEAR(seen[1].omega, repeated ? 1.0 : std::sqrt(3.0), 1e-14);
  }
}

// In the corner of two contacts impacts come ever faster.
TEST(CheckScene, TrialEndsAtItsLimitsWithVeryFrequentEvents) {
  for (const double epsilon : {0.5, 0.2}) {
    Scene scene = two_contacts(ImpactLaw::poisson, epsilon == 0.5 ? 0.5 : 0.9, epsilon);
    scene.model.contacts[1].clearance = 0.1;
    const Assessment a = assess(scene, {.events = 500});
    EXPECT_LT(a.trial.duration, a.trial.planned);
    EXPECT_LT(a.trial.closings, 600);
    EXPECT_EQ(a.trial.error, "");
  }
}

// The program.
class CheckSceneProgram : public test::ProgramTest {
 protected:
  Ended check(const test::Arguments& arguments) { return run(CHECK_SCENE, arguments); }
};

TEST_F(CheckSceneProgram, JsonHasTheExactNumbers) {
  const std::string scene = shipped("bouncing_ball");
  const Ended ended = check({scene, "--json", "--report", directory_ / "report.json"});
  EXPECT_EQ(ended.code, 3);
  const auto json = test::parse_json(ended.out);
  const Assessment a = assess(read_scene(scene));
  nlohmann::ordered_json of_library;
  write_json(a, of_library);
  for (const auto& [key, value] : of_library.items()) EXPECT_EQ(json[key], value) << key;
  EXPECT_EQ(json["synchronizes"], false);
  EXPECT_EQ(json["decades"].get<double>(), a.decades);
  EXPECT_EQ(json["smallest_eigenvalue"]["K"].get<double>(), a.K.smallest);
  EXPECT_EQ(json["modes"].back()["projection"].get<double>(), a.modes.back().projection);
  ASSERT_EQ(json["findings"].size(), a.findings.size());
  for (std::size_t i = 0; i < a.findings.size(); ++i) {
    const auto& entry = json["findings"][i];
    EXPECT_EQ(entry["id"], a.findings[i].id);
    EXPECT_EQ(entry["required"], a.findings[i].required);
    EXPECT_EQ(entry["holds"], a.findings[i].holds);
    EXPECT_EQ(entry["what"], a.findings[i].what);
  }
  EXPECT_EQ(test::parse_json(test::read_text(directory_ / "report.json"))["exit"], 3);
}

// The largest expected bound as a length, or why there is none, in words and in JSON.
TEST_F(CheckSceneProgram, GuaranteedLengthsAreStatedOrRefused) {
  constexpr const char* tolerance = "\n[tolerance]\ntime = 1e-4\n";
  const std::string rig = test::read_text(shipped("lab_rig"));
  const auto with = [&](const std::string& name, const std::string& is, const std::string& given) {
    std::string text = rig;
    const std::size_t at = text.find(is);
    EXPECT_NE(at, std::string::npos) << is;
    return test::write_text(directory_ / name, text.replace(at, is.size(), given) + tolerance)
        .string();
  };
  const auto words = [&](const std::string& file) {
    std::string text = check({file}).out;
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
  };
  const std::string usual = with("usual.toml", "[replica]", "[replica]");
  EXPECT_TRUE(says(words(usual), "guaranteed for event times to 0.1 ms: gap 1 within "))
      << words(usual);
  EXPECT_TRUE(says(words(usual), "; after a gap in the events V below ")) << words(usual);
  const auto json = test::parse_json(check({usual, "--json"}).out)["guaranteed"];
  const double width = json["half_widths"]["gap 1"];
  EXPECT_GT(width, 1e-5);
  EXPECT_LT(width, 1e-3);
  EXPECT_GT(json["bound_after_gap"].get<double>(), json["bound"].get<double>());

  const std::string damped = "C = [[3.6, -1.2], [-1.2, 1.2]]";
  const std::string held = "K = [[1800.0, -600.0], [-600.0, 600.0]]";
  for (const std::string& file :
       {with("undamped.toml", damped, "C = [[0.0, 0.0], [0.0, 0.0]]"),
        with("free.toml", held, "K = [[600.0, -600.0], [-600.0, 600.0]]")}) {
    EXPECT_TRUE(says(words(file),
                     "not guaranteed: replica.uncertainty is not given, and C or K is singular"))
        << words(file);
  }
  std::string text = test::read_text(directory_ / "free.toml");
  text.replace(text.find("[replica]"), 9, "[replica]\nuncertainty = 1.0");
  const std::string known = test::write_text(directory_ / "known.toml", text);
  EXPECT_TRUE(says(words(known), "; no length for gap 1, which no spring holds;")) << words(known);
  EXPECT_TRUE(
      says(words(known), "after a gap in the events B is infinite, since C or K is singular"))
      << words(known);
}

TEST_F(CheckSceneProgram, UncertainParametersAreListed) {
  const std::string text = test::read_text(shipped("paper_beam"));
  const std::string file = test::write_text(directory_ / "uncertain.toml", text + R"(
[parameters]
impact.restitution = { sigma = 0.01 }
beam.damping = { sigma = 0.002, consider = true }
)");
  EXPECT_TRUE(check({file}).out.ends_with(
      "\nuncertain parameters: impact.restitution 0.7 +- 0.01, beam.damping 0.17 +- 0.002 "
      "(considered)\n"))
      << check({file}).out;
  const auto json = test::parse_json(check({file, "--json"}).out);
  EXPECT_EQ(json["uncertain_parameters"], test::parse_json(R"([
    {"parameter": "impact.restitution", "unit": "", "value": 0.7, "sigma": 0.01, "consider": false},
    {"parameter": "beam.damping", "unit": "N s/m^2", "value": 0.17, "sigma": 0.002,
     "consider": true}])"));
  const Ended without = check({shipped("paper_beam")});
  EXPECT_FALSE(says(without.out, "uncertain parameters")) << without.out;
}

// Theorem 1 concerns the replica; the filter needs observability of the whole motion.
TEST(CheckScene, EveryEstimatorHasOwnPrognosis) {
  const Assessment ball = assess(read_scene(shipped("bouncing_ball")));
  EXPECT_FALSE(ball.synchronizes());
  EXPECT_FALSE(finding(ball, "by_replica").holds);
  EXPECT_TRUE(finding(ball, "by_filter").holds) << finding(ball, "by_filter").what;
  EXPECT_LT(ball.filter->known_from, 3.0);
  for (const Finding& f : ball.findings) EXPECT_FALSE(says(f.change, "spring")) << f.change;

  const Assessment beam = assess(read_scene(shipped("paper_beam")));
  EXPECT_TRUE(finding(beam, "by_replica").holds);
  EXPECT_TRUE(finding(beam, "by_filter").holds);

  // A second mass without a contact, on its own spring and without damping.
  Scene blind = two_contacts(ImpactLaw::poisson, 0.5, 0.5);
  Model& model = blind.model;
  model.C = Eigen::Vector2d(0.1, 0.0).asDiagonal();
  model.contacts = {contact(Eigen::Vector2d(1.0, 0.0), 0.5)};
  model.forces = {{Eigen::Vector2d(1.0, 0.0), 0.0, {1.0, 2.0, 0.0}}};
  blind.truth.start = {Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d::Zero()};
  blind.prior.start = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  const Assessment unseen = assess(blind);
  ASSERT_GT(unseen.filter->closings, 20);
  EXPECT_FALSE(finding(unseen, "by_filter").holds) << finding(unseen, "by_filter").what;
  EXPECT_GT(unseen.filter->left, 0.5);
}

// Without a start of the machine, a trial uses the replica's start.
TEST(CheckScene, MasterTableIsOptional) {
  Scene scene = read_scene(shipped("lab_rig"));
  scene.prior.start = scene.truth.start;
  const Assessment with = assess(scene);
  scene.truth.start.q.setConstant(1e3);
  scene.truth.given = false;
  EXPECT_EQ(assess(scene).trial.closings, with.trial.closings);
}

}  // namespace
}  // namespace sprag
