// Would catch an invalid scene that is accepted, and a message without the place or the remedy.
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"

namespace sprag {
namespace {

struct Mistake {
  std::string_view from, to, message;
};

void expect_errors(std::string_view text, const std::vector<Mistake>& mistakes) {
  ASSERT_EQ(error_of(text), "no error");
  for (const Mistake& mistake : mistakes) {
    EXPECT_EQ(error_of(replaced(text, mistake.from, mistake.to)), mistake.message)
        << mistake.from << " -> " << mistake.to;
  }
}

TEST(SceneErrors, SyntaxErrorsHaveAPosition) {
  expect_errors(
      beam_text,
      {{"length = 1.0", "length = = 1",
        "x.toml:3:10: Error while parsing value: could not determine value type"},
       {"modes = 3", "modes = 3\nmodes = 4",
        "x.toml:3:9: Error while parsing key-value pair: cannot redefine existing integer "
        "'modes'"}});
}

TEST(SceneErrors, PlaceAndMessageCanBeRead) {
  try {
    parse("\nname = 1");
    FAIL() << "not refused";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.file, "x.toml");
    EXPECT_EQ(error.line, 2);
    EXPECT_EQ(error.column, 8);
    EXPECT_EQ("x.toml:2:8: " + error.message, error.what());
  }
  try {
    read_scene("/nowhere/x.toml");
    FAIL() << "not refused";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.file, "/nowhere/x.toml");
    EXPECT_EQ(error.line, 0);
    EXPECT_EQ(error.column, 0);
    EXPECT_EQ("/nowhere/x.toml: " + error.message, error.what());
  }
}

// This input violates an assertion of toml++ 3.3.
TEST(SceneErrors, SyntaxErrorsDoNotAbort) {
  EXPECT_EQ(error_of("[^]"),
            "x.toml:1:2: Error while parsing key: expected bare key starting character or "
            "string delimiter, saw '^'");
}

TEST(SceneErrors, UnknownKeysGetASuggestionOrTheList) {
  expect_errors(
      beam_text,
      {{"amplitude", "amplitud",
        "x.toml:8:1: unknown key excitation.amplitud; did you mean amplitude?"},
       {"length", "lenght", "x.toml:3:1: unknown key beam.lenght; did you mean length?"},
       {"[excitation]", "[exitation]",
        "x.toml:7:2: unknown key exitation; did you mean excitation?"},
       {"[[contact]]", "[[contacts]]", "x.toml:15:3: unknown key contacts; did you mean contact?"},
       {"law", "lwa", "x.toml:12:1: unknown key impact.lwa; did you mean law?"},
       {"side", "Side", "x.toml:18:1: unknown key contact[1].Side; did you mean side?"},
       {"side = \"below\"", "direction = [1.0]",
        "x.toml:18:1: unknown key contact[1].direction; must be one of position, clearance, side, "
        "mount, restitution"},
       {"u = [0.0", "v = [0.0",
        "x.toml:22:1: unknown key master.v; must be one of q, u, penetration"},
       {"u = []", "penetration = \"release\"",
        "x.toml:25:1: unknown key replica.penetration; must be one of q, u, restitution, "
        "uncertainty, "
        "sigma_q, sigma_u, drift, confidence"},
       {"u = []", "confidence = \"sure\"",
        "x.toml:25:14: replica.confidence is \"sure\"; must be \"low\", \"medium\" or \"high\""}});
  expect_errors(
      system_text,
      {{"K =", "k =", "x.toml:4:1: unknown key system.k; did you mean K?"},
       {"constant", "constnat",
        "x.toml:7:1: unknown key force[1].constnat; did you mean constant?"},
       {"phase", "phse", "x.toml:15:47: unknown key contact[1].motion.phse; did you mean phase?"},
       {"clearance = 0.1", "support = \"frame\"",
        "x.toml:14:1: unknown key contact[1].support; must be one of direction, clearance, motion, "
        "mount, "
        "restitution"}});
}

TEST(SceneErrors, FirstUnknownKeyIsNamed) {
  EXPECT_EQ(error_of(replaced(beam_text, "[beam]\n", "[beam]\nzeta = 1\nalpha = 2\n")),
            "x.toml:2:1: unknown key beam.zeta; must be one of modes, length, bending_stiffness, "
            "mass_per_length, damping, damping_ratio, modal_damping");
}

TEST(SceneErrors, ImpossibleDampingRatiosAreRefused) {
  expect_errors(beam_text, {{"damping = 0.17", "damping_ratio = -0.1",
                             "x.toml:6:17: beam.damping_ratio has -0.1; must be >= 0"},
                            {"damping = 0.17", "damping_ratio = [0.1, 0.2]",
                             "x.toml:6:17: beam.damping_ratio has 2 numbers; must be one or 3"},
                            {"damping = 0.17", "damping = 0.17\ndamping_ratio = 0.1",
                             "x.toml:7:17: beam.damping_ratio and beam.damping exclude each other; "
                             "must be one of them"}});
}

TEST(SceneErrors, WrongTypesNameBoth) {
  expect_errors(
      beam_text,
      {{"modes = 3", "modes = 3.0", "x.toml:2:9: beam.modes is a float; must be an integer"},
       {"modes = 3", "modes = \"3\"", "x.toml:2:9: beam.modes is a string; must be an integer"},
       {"length = 1.0", "length = \"1\"", "x.toml:3:10: beam.length is a string; must be a number"},
       {"length = 1.0", "length = true", "x.toml:3:10: beam.length is a boolean; must be a number"},
       {"length = 1.0", "length = 2024-01-01",
        "x.toml:3:10: beam.length is a date; must be a number"},
       {"\"below\"", "1", "x.toml:18:8: contact[1].side is an integer; must be a string"},
       {"[[contact]]", "[contact]",
        "x.toml:15:1: contact is a table; must be an array of tables, [[contact]]"},
       {"[beam]", "[[beam]]", "x.toml:1:1: beam is an array of tables; must be a table"},
       {"[beam]", "contact = [1]\n[beam]",
        "x.toml:16:1: Error while parsing table header: cannot "
        "redefine existing array 'contact' as array-of-tables"},
       {"q = [-0.05, 0.0, 0.0]", "q = -0.05",
        "x.toml:21:5: master.q is a float; must be an array of numbers"},
       {"q = [-0.05, 0.0, 0.0]", "q = [-0.05, \"0\", 0.0]",
        "x.toml:21:13: master.q[2] is a string; must be a number"}});
  expect_errors(system_text,
                {{"M = [[2.0, 0.5], [0.5, 1.0]]", "M = 2.0",
                  "x.toml:2:5: system.M is a float; must be an array of rows of numbers"},
                 {"M = [[2.0, 0.5], [0.5, 1.0]]", "M = [2.0, 1.0]",
                  "x.toml:2:6: system.M[1] is a float; must be an array of numbers"},
                 {"[[2.0, 0.5], [0.5, 1.0]]", "[[2.0, 0.5], [true, 1.0]]",
                  "x.toml:2:19: system.M[2][1] is a boolean; must be a number"},
                 {"motion = { amplitude = 0.01, frequency = 4.0, phase = 0.5 }", "motion = 0.01",
                  "x.toml:15:10: contact[1].motion is a float; must be a table"}});
  EXPECT_EQ(error_of(replaced(replaced(beam_text, "[[contact]]", "#"), "[beam]",
                              "contact = [{ position = 0.5 }, 7]\n[beam]")),
            "x.toml:1:32: contact[2] is an integer; must be a table");
  EXPECT_EQ(error_of("name = 3"), "x.toml:1:8: name is an integer; must be a string");
}

TEST(SceneErrors, FreeEntriesMustBeParametersOfTheScene) {
  const auto with = [](const std::string& table) {
    return error_of(std::string(beam_text) + "\n[adapt]\n" + table);
  };
  EXPECT_NE(with("free = [\"beam.damping\", \"beam.dampin\"]")
                .find("adapt.free[2]: beam.dampin is no parameter of this scene; did you mean "
                      "beam.damping?"),
            std::string::npos)
      << with("free = [\"beam.damping\", \"beam.dampin\"]");
  for (const auto& [given, error] :
       {std::pair("free = []", "adapt.free is empty; must name one parameter at least"),
        std::pair("free = [1]", "adapt.free[1] is an integer; must be a string"),
        std::pair("free = \"all\"", "adapt.free is a string; must be an array of strings"),
        std::pair("free = [\"beam.damping\", \"beam.damping\"]",
                  "adapt.free[2] is beam.damping again; must be another one"),
        std::pair("within = 0.0", "adapt.within has 0; must be in (0, 10]"),
        std::pair("within = 11.0", "adapt.within has 11; must be in (0, 10]"),
        std::pair("walk = -1e-3", "adapt.walk has -0.001; must be >= 0"),
        std::pair("walk = [1e-3, 1e-3]", "adapt.walk has 2 numbers; must be one or 1"),
        std::pair("wlak = 1.0", "unknown key adapt.wlak; did you mean walk?")}) {
    EXPECT_NE(with(given).find(error), std::string::npos) << with(given);
  }
  const Scene scene = parse_scene(std::string(beam_text) +
                                      "\n[adapt]\nfree = [\"beam.damping\", "
                                      "\"impact.restitution\"]\nwithin = 0.3\nwalk = [0.0, 1e-3]",
                                  "x.toml");
  EXPECT_EQ(scene.prior.adaptation.free.size(), 2U);
  EXPECT_EQ(scene.prior.adaptation.within, Eigen::Vector2d(0.3, 0.3));
  EXPECT_EQ(scene.prior.adaptation.walk, Eigen::Vector2d(0.0, 1e-3));
}

TEST(SceneErrors, StandardDeviationsReplaceEnergy) {
  const auto with = [](const std::string& more) {
    return replaced(beam_text, "u = []", "u = []\n" + more);
  };
  const Scene scene = parse(with("sigma_q = 0.25\nsigma_u = [1, 2.0, 3]"));
  ASSERT_TRUE(scene.prior.sigma);
  EXPECT_EQ(scene.prior.sigma->q, Eigen::Vector3d(0.25, 0.25, 0.25));
  EXPECT_EQ(scene.prior.sigma->u, Eigen::Vector3d(1.0, 2.0, 3.0));
  const Uncertainty uncertainty = uncertainty_of(scene);
  EXPECT_EQ(uncertainty.q, Eigen::MatrixXd(scene.prior.sigma->q.asDiagonal()));
  EXPECT_EQ(uncertainty.u, Eigen::MatrixXd(scene.prior.sigma->u.asDiagonal()));
  EXPECT_EQ(error_of(with("sigma_q = 0.25")), "x.toml:23:1: missing key replica.sigma_u");
  EXPECT_EQ(error_of(with("sigma_q = 0.25\nsigma_u = 0")),
            "x.toml:27:11: replica.sigma_u has 0; must be > 0");
  EXPECT_EQ(error_of(with("sigma_q = 0.25\nsigma_u = 1\nuncertainty = 1")),
            "x.toml:26:11: replica.sigma_q and replica.uncertainty exclude each other; must be one "
            "of them");
  const Scene again = parse(to_toml(scene));
  EXPECT_EQ(again.prior.sigma->u, scene.prior.sigma->u);
  EXPECT_EQ(again.prior.sigma->q, scene.prior.sigma->q);
}

TEST(SceneErrors, TolerancesAreLimited) {
  const auto with = [](const std::string& line) {
    return "[tolerance]\n" + line + '\n' + std::string(beam_text);
  };
  for (const auto& [line, error] :
       {std::pair("time = -1e-3", "x.toml:2:8: tolerance.time is -0.001; must be >= 0"),
        std::pair("restitution = 1.5",
                  "x.toml:2:15: tolerance.restitution is 1.5; must be in [0, 1]"),
        std::pair("stiffness = 0.6",
                  "x.toml:2:13: tolerance.stiffness is 0.6; must be in [0, 0.5]"),
        std::pair("damping = -1", "x.toml:2:11: tolerance.damping is -1; must be in [0, 0.5]"),
        std::pair("force = -1", "x.toml:2:9: tolerance.force is -1; must be >= 0"),
        std::pair("clearance = -1", "x.toml:2:13: tolerance.clearance is -1; must be >= 0")}) {
    EXPECT_EQ(error_of(with(line)), error);
  }
  EXPECT_NE(error_of(with("times = 1")).find("tolerance.time"), std::string::npos);
  EXPECT_FALSE(parse(std::string(beam_text)).prior.tolerance.any());
  const Tolerance tolerance = parse(with("time = 1e-4\nclearance = 2e-3")).prior.tolerance;
  EXPECT_EQ(tolerance, (Tolerance{.time = 1e-4, .clearance = 2e-3}));
}

TEST(SceneErrors, ContactClockHasARateAndAnOffset) {
  const auto with = [](const std::string& line) {
    return std::string(beam_text) + "\n[clock]\n" + line + "\n";
  };
  EXPECT_NE(error_of(with("rate = 0.0")).find("clock.rate is 0; must be > 0"), std::string::npos);
  EXPECT_NE(error_of(with("rate = -1.0")).find("clock.rate is -1; must be > 0"), std::string::npos);
  EXPECT_NE(error_of(with("drift = 1.0")).find("unknown key clock.drift"), std::string::npos);
  EXPECT_EQ(parse(std::string(beam_text)).clock, ContactClock());
  EXPECT_EQ(parse(with("rate = 1.0002\noffset = -0.5")).clock,
            (ContactClock{.offset = -0.5, .rate = 1.0002}));
}

TEST(SceneErrors, UncertaintiesMustBePositiveAndOfCorrectLength) {
  const std::string events = "[events]\njitter = -1e-3\n";
  EXPECT_EQ(error_of(events + std::string(beam_text)),
            "x.toml:2:10: events.jitter is -0.001; must be >= 0");
  for (const auto& [given, error] :
       {std::pair("0.0", "replica.uncertainty has 0; must be > 0"),
        std::pair("[1.0, 2.0]", "replica.uncertainty has 2 numbers; must be one energy or 3"),
        std::pair("\"much\"",
                  "replica.uncertainty names a file: much: No such file or directory")}) {
    const std::string text =
        replaced(beam_text, "u = []", "u = []\nuncertainty = " + std::string(given));
    EXPECT_NE(error_of(text).find(error), std::string::npos) << error_of(text);
  }
}

TEST(SceneErrors, NonAsciiCharactersOnlyInCommentsAndQuotes) {
  const std::string refused =
      ": a character beyond ASCII; may only be in a comment or between quotes";
  EXPECT_EQ(error_of("name = \xC3\xA4"), "x.toml:1:8" + refused);
  EXPECT_EQ(error_of("# \xC3\xA4\n\n  \xE2\x80\xA9 = 1"), "x.toml:3:3" + refused);
  EXPECT_EQ(error_of("name = ''\xC2\xB5"), "x.toml:1:10" + refused);
  EXPECT_EQ(error_of("name = \"a\\\"\" \xC2\xB5"), "x.toml:1:14" + refused);
  const std::string beam(beam_text);
  for (const char* name :
       {"name = \"k\xC3\xB6rper\"\n", "name = 'k\xC3\xB6rper' # \xC2\xB5\n",
        "name = \"\"\"\nk\"\"\xC3\xB6rper\"\"\"\n", "\xEF\xBB\xBFname = \"a\" # \xC2\xB5\n"}) {
    EXPECT_NO_THROW(parse_scene(name + beam, "x.toml")) << name;
  }
}

TEST(SceneErrors, NumbersMustBeFinite) {
  expect_errors(beam_text, {{"length = 1.0", "length = nan",
                             "x.toml:3:10: beam.length is nan; must be finite"},
                            {"amplitude = 0.03", "amplitude = -inf",
                             "x.toml:8:13: excitation.amplitude is -inf; must be finite"},
                            {"clearance = 0.01", "clearance = inf",
                             "x.toml:17:13: contact[1].clearance is inf; must be finite"},
                            {"u = [0.0, 0.0, 0.0]", "u = [0.0, nan, 0.0]",
                             "x.toml:22:11: master.u[2] is nan; must be finite"}});
  expect_errors(system_text,
                {{"[-1, 3.0]", "[-1, inf]", "x.toml:4:20: system.K[2][2] is inf; must be finite"}});
}

TEST(SceneErrors, NumbersMustBeInRange) {
  expect_errors(
      beam_text,
      {{"modes = 3", "modes = 0", "x.toml:2:9: beam.modes is 0; must be in 1..200"},
       {"modes = 3", "modes = 201", "x.toml:2:9: beam.modes is 201; must be in 1..200"},
       {"length = 1.0", "length = 0", "x.toml:3:10: beam.length is 0; must be > 0"},
       {"stiffness = 1.0", "stiffness = -1.0",
        "x.toml:4:21: beam.bending_stiffness is -1; must be > 0"},
       {"mass_per_length = 1.0", "mass_per_length = 0.0",
        "x.toml:5:19: beam.mass_per_length is 0; must be > 0"},
       {"damping = 0.17", "damping = -0.17", "x.toml:6:11: beam.damping is -0.17; must be >= 0"},
       {"frequency = 9.5", "frequency = -9.5",
        "x.toml:9:13: excitation.frequency is -9.5; must be >= 0"},
       {"restitution = 0.7", "restitution = 1.2",
        "x.toml:13:15: impact.restitution is 1.2; must be in [0, 1]"},
       {"restitution = 0.7", "restitution = { value = 0.7, slope = 0.1 }",
        "x.toml:13:38: impact.restitution.slope is 0.1; must be <= 0"},
       {"restitution = 0.7", "restitution = { value = 0.7 }",
        "x.toml:13:15: missing key impact.restitution.slope"},
       {"restitution = 0.7", "restitution = { at = [0.1, 1.0], value = [0.7] }",
        "x.toml:13:42: impact.restitution.value has 1 entries; must have 2, one for each entry of "
        "at"},
       {"restitution = 0.7", "restitution = { at = [0.1, 0.1], value = [0.7, 0.6] }",
        "x.toml:13:28: impact.restitution.at[2] is 0.1; must be > 0.1, the speed before it"},
       {"restitution = 0.7", "restitution = { at = [0.1, 1.0], value = [0.7, 1.6] }",
        "x.toml:13:48: impact.restitution.value[2] is 1.6; must be in [0, 1]"},
       {"restitution = 0.7", "restitution = { at = [1.0, 1.1], value = [0.9, 0.1] }",
        "x.toml:13:42: impact.restitution.value changes too fast: d(restitution * speed)/d(speed) "
        "is up to 8.7 in size; must be at most 1, since an impact would bring two motions apart"},
       {"restitution = 0.7", "restitution = -1",
        "x.toml:13:15: impact.restitution is -1; must be in [0, 1]"},
       {"chatter_time = 1e-7", "chatter_time = 0.0",
        "x.toml:14:16: impact.chatter_time is 0; must be > 0"},
       {"position = 0.868", "position = 1.5",
        "x.toml:16:12: contact[1].position is 1.5; must be in (0, 1]"},
       {"position = 0.868", "position = 0.0",
        "x.toml:16:12: contact[1].position is 0; must be in (0, 1]"},
       {"position = 0.868", "position = 1e-100",
        "x.toml:16:12: contact[1].position is 1e-100; must be where the beam moves (all v_i are "
        "0)"},
       {"mount = \"ground\"", "restitution = 1.5",
        "x.toml:19:15: contact[1].restitution is 1.5; must be in [0, 1]"},
       {"frequency = 9.5", "frequency = 1e200",
        "x.toml:9:13: excitation.frequency is 1e+200; must be smaller (amplitude frequency^2 "
        "overflows)"},
       {"length = 1.0", "length = 1e-120",
        "x.toml:1:1: beam has M, C or K beyond the range of doubles; must be in other units"}});
  expect_errors(system_text, {{"frequency = 2.0", "frequency = -2",
                               "x.toml:9:13: force[1].frequency is -2; must be >= 0"},
                              {"frequency = 4.0", "frequency = -4",
                               "x.toml:15:42: contact[1].motion.frequency is -4; must be >= 0"}});
}

TEST(SceneErrors, WordsMustBeKnown) {
  expect_errors(
      beam_text,
      {{"\"poisson\"", "\"moreau\"",
        "x.toml:12:7: impact.law is \"moreau\"; must be \"poisson\" or \"newton\""},
       {"\"below\"", "\"left\"",
        "x.toml:18:8: contact[1].side is \"left\"; must be \"below\" or \"above\""},
       {"\"ground\"", "\"wall\"",
        "x.toml:19:9: contact[1].mount is \"wall\"; must be \"ground\" or \"frame\""},
       {"[replica]", "penetration = \"allow\"\n[replica]",
        "x.toml:23:15: master.penetration is \"allow\"; must be \"refuse\" or \"release\""}});
}

TEST(SceneErrors, MissingKeysAndTablesAreNamed) {
  expect_errors(beam_text,
                {{"length = 1.0\n", "", "x.toml:1:1: missing key beam.length"},
                 {"amplitude = 0.03\n", "", "x.toml:7:1: missing key excitation.amplitude"},
                 {"position = 0.868\n", "", "x.toml:15:1: missing key contact[1].position"},
                 {"restitution = 0.7\n", "",
                  "x.toml:11:1: missing key impact.restitution or contact[1].restitution"}});
  expect_errors(
      system_text,
      {{"C = [[0.1, 0.0], [0.0, 0.2]]\n", "", "x.toml:1:1: missing key system.C"},
       {"direction = [1.0, 2.0]\n", "", "x.toml:5:1: missing key force[1].direction"},
       {"frequency = 2.0\n", "", "x.toml:5:1: missing key force[1].frequency"},
       {"constant = -9.81\namplitude = 0.3\nfrequency = 2.0\n", "",
        "x.toml:5:1: missing key force[1].constant or force[1].amplitude"},
       {"amplitude = 0.01, ", "", "x.toml:15:10: missing key contact[1].motion.amplitude"},
       {"direction = [0.0, 1.0]\n", "", "x.toml:12:1: missing key contact[1].direction"},
       {"[impact]\nrestitution = 0.5\n", "",
        "x.toml:10:1: missing key impact.restitution or contact[1].restitution"}});
  EXPECT_EQ(error_of(""), "x.toml:1:1: missing table [beam] or [system]");
  EXPECT_EQ(error_of("[system]\nM = [[1]]\nC = [[0]]\nK = [[0]]"),
            "x.toml:1:1: missing table [[contact]]");
}

TEST(SceneErrors, BeamAndSystemDoNotMix) {
  EXPECT_EQ(error_of(std::string(beam_text) + "[system]\nM = [[1]]\n"),
            "x.toml:26:1: system and beam exclude each other; must be one of them");
  EXPECT_EQ(error_of(std::string(beam_text) + "[[force]]\ndirection = [1.0]\n"),
            "x.toml:26:1: force is for a [system]; a [beam] has [excitation]");
  EXPECT_EQ(error_of(std::string(system_text) + "[excitation]\namplitude = 1.0\n"),
            "x.toml:18:1: missing key excitation.influence");
}

TEST(SceneErrors, MatricesMustFitAndBeDefinite) {
  constexpr std::string_view m = "[[2.0, 0.5], [0.5, 1.0]]";
  constexpr std::string_view c = "[[0.1, 0.0], [0.0, 0.2]]";
  constexpr std::string_view k = "[[3, -1], [-1, 3.0]]";
  expect_errors(system_text,
                {{m, "[]", "x.toml:2:5: system.M is empty; must have at least one row"},
                 {m, "[[2.0, 0.5, 0.0], [0.5, 1.0, 0.0]]",
                  "x.toml:2:6: system.M[1] has size 3; must be 2, the number of rows"},
                 {m, "[[2.0, 0.5], [0.5]]",
                  "x.toml:2:18: system.M[2] has size 1; must be 2, the number of rows"},
                 {m, "[[2.0, 0.5], [0.4, 1.0]]",
                  "x.toml:2:19: system.M[2][1] is 0.4; must be 0.5, as system.M[1][2] (symmetric)"},
                 {m, "[[2.0, 0.0], [0.0, -1.0]]",
                  "x.toml:2:5: system.M has the eigenvalue -1; must be positive definite"},
                 {m, "[[1.0, 0.0], [0.0, 0.0]]",
                  "x.toml:2:5: system.M has the eigenvalue 0; must be positive definite"},
                 {m, "[[1.0, 2.0], [2.0, 1.0]]",
                  "x.toml:2:5: system.M has the eigenvalue -1; must be positive definite"},
                 {c, "[[0.1]]", "x.toml:3:5: system.C is 1 x 1; must be 2 x 2, as system.M"},
                 {c, "[[-0.5, 0], [0, 1]]",
                  "x.toml:3:5: system.C has the eigenvalue -0.5; must be positive semidefinite "
                  "(negative damping, as of flutter or self-excitation, is not supported: between "
                  "impacts the motion would grow without bound)"},
                 {k, "[[3, -1, 0], [-1, 3, 0], [0, 0, 1]]",
                  "x.toml:4:5: system.K is 3 x 3; must be 2 x 2, as system.M"},
                 {k, "[[0, 1], [1, 0]]",
                  "x.toml:4:5: system.K has the eigenvalue -1; must be positive semidefinite "
                  "(negative stiffness, as of an inverted pendulum or a buckled beam, is not "
                  "supported: between impacts the motion would grow without bound)"}});
}

// toml++ parses nested tables recursively.
TEST(SceneErrors, DeepNestingIsRefused) {
  const auto repeated = [](const std::string& text, int count) {
    std::string all;
    for (int i = 0; i < count; ++i) all += text;
    return all;
  };
  EXPECT_EQ(error_of("# a.b\n" + repeated("a.", 50000) + "a = 1"),
            "x.toml:2:64: a key has more than 32 parts between dots; must have at most 32");
  EXPECT_EQ(error_of(repeated("'a.b' .", 50000) + "a = 1"),
            "x.toml:1:224: a key has more than 32 parts between dots; must have at most 32");
  EXPECT_EQ(error_of("[" + repeated("a.", 50000) + "a]"),
            "x.toml:1:65: a key has more than 32 parts between dots; must have at most 32");
  for (const std::string open : {"[", "{", "{ a = ", "[{ a = "}) {
    const std::string error = error_of("x = " + repeated(open, 200000));
    EXPECT_NE(error.find("brackets are nested more than 32 deep; must be at most 32"),
              std::string::npos)
        << error;
  }
  EXPECT_EQ(error_of("x = " + repeated("[", 33)),
            "x.toml:1:37: brackets are nested more than 32 deep; must be at most 32");
  // Brackets in strings and comments are not counted; neither is a large number of numbers and
  // tables.
  const std::string harmless = "name = \"" + repeated("[a.", 500) + "\" # " + repeated("{.", 500) +
                               "\n" + std::string(beam_text);
  EXPECT_EQ(error_of(harmless), "no error");
}

TEST(SceneErrors, VectorsMustFit) {
  expect_errors(
      system_text,
      {{"direction = [1.0, 2.0]", "direction = [1.0]",
        "x.toml:6:13: force[1].direction has size 1; must be 2, as many as coordinates"},
       {"direction = [0.0, 1.0]", "direction = [0.0, 1.0, 2.0]",
        "x.toml:13:13: contact[1].direction has size 3; must be 2, as many as coordinates"},
       {"direction = [0.0, 1.0]", "direction = [0, 0]",
        "x.toml:13:13: contact[1].direction is zero; must have an entry that is not (the contact "
        "sees nothing)"},
       {"q = [0.1, 0.2]", "q = [0.1, 0.2, 0.3]",
        "x.toml:17:5: master.q has size 3; must be at most 2, the number of coordinates"}});
  expect_errors(beam_text, {{"u = []", "u = [1, 2, 3, 4]",
                             "x.toml:25:5: replica.u has size 4; must be at most 3, the number of "
                             "coordinates"}});
}

TEST(SceneErrors, AtMostSixtyContacts) {
  std::string text(beam_text);
  for (int i = 2; i <= max_contacts; ++i) text += "[[contact]]\nposition = 0.5\n";
  EXPECT_EQ(parse(text).model.contacts.size(), 60U);
  EXPECT_EQ(error_of(text + "[[contact]]\nposition = 0.5\n"),
            "x.toml:144:1: contact has 61 tables; must have at most 60");
}

TEST(SceneErrors, MasterMustNotStartInsideASupport) {
  const std::string inside =
      "[system]\nM = [[1]]\nC = [[0]]\nK = [[0]]\n[impact]\nrestitution = 0.5\n"
      "[[contact]]\ndirection = [1]\n[[contact]]\ndirection = [-1]\nclearance = 0.25\n"
      "[master]\nu = [1]\nq = [0.5]\n";
  EXPECT_EQ(error_of(inside),
            "x.toml:14:5: master.q starts inside the support of contact 2: its gap is -0.25; must "
            "be >= 0 (move master.q or contact[2].clearance), or set master.penetration = "
            "\"release\"");
  EXPECT_TRUE(parse(inside + "penetration = \"release\"\n").truth.release_penetration);
  EXPECT_EQ(error_of(inside + "penetration = \"refuse\"\n"), error_of(inside));
  EXPECT_EQ(error_of(replaced(inside, "q = [0.5]", "q = [0.25]")), "no error");
  // Without [master] the machine's start is unknown, and not 0.
  const Scene without =
      parse(replaced(replaced(inside, "[master]\nu = [1]\nq = [0.5]\n", ""), "0.25", "-0.25"));
  EXPECT_FALSE(without.truth.given);
}

}  // namespace
}  // namespace sprag
