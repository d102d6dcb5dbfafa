// identify with the other programs: a master that differs from the scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

#include "command_line/program.h"
#include "lcmtypes/channel_log.h"
#include "lcmtypes/contact_log.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/mechanics/definiteness.h"
#include "sprag/scene_file.h"
#include "studies/identification/drifting.h"
#include "tests/support/program_test.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"
#include "tools/identify/fitted_text.h"
#include "tools/identify/options.h"

namespace sprag {
namespace {

using test::Arguments;
using test::read_text;
using test::shipped_scene;
using test::write_text;

std::string scene_file(const std::string& name) {
  return SPRAG_SOURCE_DIR "/scenes/" + name + ".toml";
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

class IdentifyProgramTest : public test::ProgramTest {
 protected:
  Ended identify(const Arguments& arguments) { return run(IDENTIFY, arguments); }

  /// Writes the events on a contact clock, with a jitter, as a CSV.
  std::string write_events(const std::vector<ContactEvent>& events, double jitter = 0.0,
                           const ContactClock& clock = {}) {
    std::mt19937_64 engine(5);
    std::normal_distribution<double> normal;
    EventsWriter writer(path("events.csv"));
    double last = 0.0;
    for (ContactEvent event : events) {
      event.t = last = std::max(last, clock_time(clock, event.t) + jitter * normal(engine));
      writer.write(event);
    }
    EXPECT_TRUE(writer.close());
    return path("events.csv");
  }

  std::string events_of(const std::string& text, double duration, double jitter = 0.0) {
    return write_events(test::events_of(parse_scene(text, "real.toml"), duration), jitter);
  }
};

TEST_F(IdentifyProgramTest, SingleCauseIsNamedAndResultsAreWritten) {
  const std::string beam = scene_file("paper_beam");
  const std::string text = read_text(beam);
  const std::string events =
      events_of(replaced(text, "restitution = 0.7", "restitution = 0.65"), 60);
  const Ended ended =
      identify({events, beam, "--output", path("fitted.toml"), "--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("paper_beam: the events fit"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("impact.restitution 0.65 instead of 0.7 alone explains the events"),
            std::string::npos)
      << ended.out;
  EXPECT_NE(ended.out.find("excitation.amplitude     held"), std::string::npos) << ended.out;
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_EQ(report["fits"], true);
  EXPECT_EQ(report["exit"], 0);
  ASSERT_EQ(report["simplest"].size(), 1U);
  EXPECT_EQ(report["simplest"][0][0]["parameter"], "impact.restitution");

  const std::string fitted = read_text(path("fitted.toml"));
  EXPECT_NE(fitted.find("# l [m]"), std::string::npos);
  const Scene scene = read_scene(path("fitted.toml"));
  EXPECT_NEAR(scene.model.contacts[0].restitution, 0.65, 1e-10);
  EXPECT_NEAR(scene.prior.start.q[0], -0.05, 1e-9);
  EXPECT_NEAR(scene.truth.start.q[0], -0.05, 1e-9);
  EXPECT_EQ(scene.prior.jitter, 0.0);
}

// Fitted values must be written in the place that each kind of scene uses.
TEST_F(IdentifyProgramTest, FittedScenesOfAllKindsAreReadBack) {
  struct Case {
    const char *scene, *what, *by, *free;
    double duration;
  };
  for (const Case& of :
       {Case{"lab_rig", "4.5 Hz [rad/s]", "4.5 Hz [rad/s]\nphase = 0.4", "", 20.0},
        Case{"non_proportional", "frequency = 9.5 }", "frequency = 9.5, phase = 0.0 }",
             "impact.restitution,system.K,system.C,excitation.phase,excitation.frequency", 40.0},
        Case{"lab_rig", "M = [[0.9, 0.0], [0.0, 0.6]]", "M = [[0.9, 0.02], [0.02, 0.61]]",
             "system.M.1.2,system.M.2.2,contact.1.direction.1,contact.1.direction.2", 20.0},
        Case{"lab_rig", "amplitude = 5.0 ", "constant = 0.3\namplitude = 5.0 ", "force.1.constant",
             20.0},
        Case{"two_stops_beam", "clearance = 0.05", "clearance = 0.052",
             "contact.2.clearance,contact.1.restitution", 6.0}}) {
    const std::string text = read_text(scene_file(of.scene));
    const std::string events = events_of(replaced(text, of.what, of.by), of.duration);
    Arguments arguments{events, scene_file(of.scene), "--output", path("fitted.toml")};
    if (*of.free != '\0') arguments.insert(arguments.end(), {"--free", of.free});
    const Ended ended = identify(arguments);
    EXPECT_EQ(ended.code, 0) << of.scene << ended.out << ended.err;
    EXPECT_EQ(ended.err.find("is not listed"), std::string::npos) << ended.err;
    const Scene fitted = read_scene(path("fitted.toml"));
    std::string listed;
    for (const std::string& key : fitted.prior.parameters.keys) listed += "," + key;
    if (*of.free != '\0') {
      EXPECT_EQ(listed, std::string(",") + of.free);
    }
    const Scene real = parse_scene(replaced(text, of.what, of.by), "real.toml");
    EXPECT_LT((fitted.model.M - real.model.M).norm(), 1e-7 * real.model.M.norm()) << of.scene;
    EXPECT_LT((fitted.model.K - real.model.K).norm(), 1e-7 * real.model.K.norm()) << of.scene;
    EXPECT_LT((fitted.model.C - real.model.C).norm(), 1e-7 * real.model.C.norm()) << of.scene;
    for (std::size_t j = 0; j < real.model.forces.size(); ++j) {
      EXPECT_NEAR(fitted.model.forces[j].constant, real.model.forces[j].constant, 1e-7);
      EXPECT_NEAR(value(fitted.model.forces[j].harmonic, 1.0),
                  value(real.model.forces[j].harmonic, 1.0), 1e-7)
          << of.scene;
    }
    for (std::size_t i = 0; i < real.model.contacts.size(); ++i) {
      const Eigen::VectorXd& w = real.model.contacts[i].w;
      EXPECT_LT((fitted.model.contacts[i].w - w).norm(), 1e-7 * w.norm()) << of.scene;
      EXPECT_NEAR(fitted.model.contacts[i].clearance, real.model.contacts[i].clearance, 1e-8);
      EXPECT_NEAR(fitted.model.contacts[i].restitution, real.model.contacts[i].restitution, 1e-8);
    }
  }
}

// A record of a clock that is fast. The written scene has the clock, and explains the record.
TEST_F(IdentifyProgramTest, AFastContactClockIsNamedAndWritten) {
  const std::string rig = scene_file("lab_rig");
  const ContactClock clock{.offset = 0.004, .rate = 0.9997};
  const std::string events =
      write_events(test::events_of(shipped_scene("lab_rig"), 15.0), 1e-5, clock);
  const Ended ended = identify({events, rig, "--jitter", "1e-5", "--free",
                                "clock.rate,clock.offset", "--output", path("fitted.toml"),
                                "--events", path("mended.csv"), "--report", path("report.json")});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.err.find("clock.rate is not listed in [parameters]"), std::string::npos);
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_TRUE(report["clock_ambiguities"].empty());
  const Scene fitted = read_scene(path("fitted.toml"));
  EXPECT_NEAR(fitted.clock.rate, clock.rate, 3e-5);
  EXPECT_NEAR(fitted.clock.offset, clock.offset, 1e-3);
  for (const auto& [k, value] : {std::pair(0, clock.rate), std::pair(1, clock.offset)}) {
    const auto& of = report["parameters"][static_cast<std::size_t>(k)];
    EXPECT_LT(std::abs(of["value"].get<double>() - value), 4.5 * of["sigma"].get<double>()) << of;
  }
  // The mended events are on the clock of the record.
  const auto mended = read_events(path("mended.csv"), 1).events;
  const auto recorded = read_events(events, 1).events;
  ASSERT_EQ(mended.size(), recorded.size());
  EXPECT_NEAR(mended.back().t, recorded.back().t, 1e-12 * recorded.back().t);
  // The written scene explains the record without changes.
  const Ended again = identify({events, path("fitted.toml"), "--jitter", "1e-5", "--json"});
  EXPECT_EQ(again.code, 0) << again.out;
  EXPECT_TRUE(test::parse_json(again.out)["simplest"].at(0).empty()) << again.out;
}

TEST_F(IdentifyProgramTest, AFastContactClockIsTheSingleCauseUnlessItsRateIsAmbiguous) {
  const std::string beam = scene_file("paper_beam");
  const std::string events =
      write_events(test::events_of(shipped_scene("paper_beam"), 60.0), 1e-4, {.rate = 1.0002});
  const std::string out = identify({events, beam, "--jitter", "1e-4"}).out;
  EXPECT_NE(out.find("A contact clock that is "), std::string::npos) << out;
  EXPECT_NE(out.find(" ppm fast (clock.rate 1.000"), std::string::npos) << out;
  EXPECT_NE(out.find("instead of 1) alone explains the events."), std::string::npos) << out;
  // A change of all that has a time is the same.
  const Ended ended =
      identify({events, beam, "--jitter", "1e-4", "--report", path("report.json"), "--free",
                "clock.rate,beam.damping,beam.bending_stiffness,excitation.frequency"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("clock.rate is not determined: the same event times follow from a "
                           "change of beam.bending_stiffness, beam.damping and "
                           "excitation.frequency together. Hold one of them: leave it out of "
                           "--free."),
            std::string::npos)
      << ended.out;
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_EQ(report["parameters"].back()["determined"], false);
  ASSERT_EQ(report["clock_ambiguities"].size(), 1U);
  EXPECT_EQ(report["clock_ambiguities"][0]["equals"].size(), 3U);
}

// A shaken frame with matrix files; the fitted scene is written to another folder.
TEST_F(IdentifyProgramTest, AShakenFrameAndItsFiles) {
  write_text(path("M.csv"), "2 0\n0 1\n");
  write_text(path("K.csv"), "900 -400\n-400 400\n");
  const auto scene = [&](double factor, double alpha, double beta, double frequency) {
    const std::string text =
        "[system]\nM = \"M.csv\"\nK = \"K.csv\"\nrayleigh = { alpha = " + std::to_string(alpha) +
        ", beta = " + std::to_string(beta) +
        " }\n[excitation]\ninfluence = 1\namplitude = 0.01\nfrequency = " +
        std::to_string(frequency) +
        "\n[impact]\nrestitution = 0.6\n[[contact]]\ndirection = [0.0, 1.0]\nclearance = 0.005\n";
    write_text(path("scene.toml"), text);
    Scene read = read_scene(path("scene.toml"));
    read.model.K *= factor;
    return read;
  };
  Scene real = scene(1.05, 0.3, 0.001, 11.0);
  real.model.C *= 1.1;
  write_events(test::events_of(real, 15.0));
  scene(1.0, 0.3, 0.001, 11.2);
  std::filesystem::create_directory(path("out"));
  const Ended ended =
      identify({path("events.csv"), path("scene.toml"), "--output", path("out/fitted.toml"),
                "--free", "system.K,system.C,excitation.frequency,excitation.phase"});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  const Scene fitted = read_scene(path("out/fitted.toml"));
  EXPECT_EQ(fitted.model.M, real.model.M);
  EXPECT_LT((fitted.model.K - real.model.K).norm(), 1e-6 * real.model.K.norm());
  EXPECT_LT((fitted.model.C - real.model.C).norm(), 1e-5 * real.model.C.norm());
  EXPECT_NEAR(fitted.frame->motion.frequency, 11.0, 1e-6);
  EXPECT_NEAR(fitted.frame->motion.amplitude, 0.01, 1e-15);
  const std::string text = read_text(path("out/fitted.toml"));
  EXPECT_NE(text.find("M = \"../M.csv\""), std::string::npos) << text;
  EXPECT_EQ(text.find("K.csv"), std::string::npos) << text;
}

// Events after the loss count like those before it.
TEST_F(IdentifyProgramTest, ALogThatLostRecords) {
  const std::string beam = scene_file("paper_beam");
  const Scene real = parse_scene(
      replaced(read_text(beam), "restitution = 0.7", "restitution = 0.65"), "real.toml");
  const auto events = test::events_of(real, 240.0);
  write_contact_log(path("whole.lcmlog"), events, 1, 240.0, std::nullopt);
  ChannelLogReader whole(path("whole.lcmlog"));
  ChannelLogWriter part(path("part.lcmlog"));
  ChannelRecord record;
  int messages = 0;
  for (; whole.next(record); ++messages) {
    if (messages < 60 || messages > 200) part.write(record.utime, record.channel, record.data);
  }
  ASSERT_TRUE(part.close());
  ASSERT_GT(messages, 300);
  const Ended ended = identify({path("part.lcmlog"), beam, "--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.err.find("events may be missing from t = "), std::string::npos) << ended.err;
  EXPECT_EQ(ended.err.find("everything before is used"), std::string::npos) << ended.err;
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_GE(report["stretches"].get<int>(), 2);
  EXPECT_GT(report["impacts"], 200);
  EXPECT_GT(report["to"], 200.0);
  EXPECT_NEAR(report["parameters"][0]["value"].get<double>(), 0.65, 1e-9);
}

TEST_F(IdentifyProgramTest, DriftIsReportedAndWritten) {
  const std::string events = write_events(identification_study::drifting_events(
      shipped_scene("paper_beam"), 1e-8, 1e-4, 60.0, 0.05, 1));
  const Ended found = identify({events, scene_file("paper_beam"), "--within", "0.05", "--accept",
                                "--output", path("fitted.toml"), "--report", path("report.json")});
  ASSERT_EQ(found.code, 0) << found.out << found.err;
  EXPECT_NE(found.out.find("The machine drifts from its model: drift "), std::string::npos)
      << found.out;
  EXPECT_EQ(test::parse_json(read_text(path("report.json")))["drift"]["found"], true);
  const Scene fitted = read_scene(path("fitted.toml"));
  EXPECT_GT(fitted.prior.drift, 3e-9);
  EXPECT_LT(fitted.prior.drift, 3e-8);
  EXPECT_NEAR(fitted.prior.jitter, 1e-4, 4e-5);
}

TEST_F(IdentifyProgramTest, TooFewEventsAndBadUsage) {
  const std::string beam = scene_file("paper_beam");
  const std::string events = events_of(read_text(beam), 60.0);
  const Ended few = identify({events, beam, "--duration", "3"});
  EXPECT_EQ(few.code, 1);
  EXPECT_NE(few.err.find("impacts"), std::string::npos) << few.err;
  const Ended misspelled = identify({events, beam, "--free", "beam.dampin"});
  EXPECT_EQ(misspelled.code, 2);
  EXPECT_NE(misspelled.err.find("did you mean beam.damping?"), std::string::npos) << misspelled.err;
  const Ended swapped = identify({beam, events});
  EXPECT_EQ(swapped.code, 2);
  EXPECT_NE(swapped.err.find("the order is LOG SCENE"), std::string::npos) << swapped.err;
  for (const Arguments& arguments :
       {Arguments{}, Arguments{events}, Arguments{path("absent.csv"), beam},
        Arguments{events, path("absent.toml")}, Arguments{events, beam, "--within", "-1"},
        Arguments{events, beam, "--within", "0.2x"}, Arguments{events, beam, "--within", "x=0.2"},
        Arguments{events, beam, "--known", "contact.2.clearance"},
        Arguments{events, beam, "--free", "beam.damping", "--known", "beam.damping"},
        Arguments{events, beam, "--output", beam}, Arguments{events, beam, "--jitter", "0"}}) {
    EXPECT_EQ(identify(arguments).code, 2);
  }
}

// The report's numbers are in the written scene, instead of the previous ones.
TEST_F(IdentifyProgramTest, UncertaintyReplacesTheOldOne) {
  const std::string text = read_text(scene_file("paper_beam"));
  const std::string events =
      events_of(replaced(text, "restitution = 0.7", "restitution = 0.68"), 60);
  const std::string old = R"(
# kept
[parameters]
consider = true
beam.damping = { sigma = 0.5 }   # gone
excitation.amplitude = { sigma = 0.125 }
correlation = [["beam.damping", "excitation.amplitude", 0.5]]
)";
  write_text(path("given.toml"), text + old);
  const Ended ended =
      identify({events, path("given.toml"), "--output", path("fitted.toml"), "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const Scene fitted = read_scene(path("fitted.toml"));
  const ParameterUncertainty& parameters = fitted.prior.parameters;
  const auto json = test::parse_json(ended.out);
  ASSERT_EQ(parameters.keys.size(), json["parameters"].size());
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const auto& of = json["parameters"][k];
    const std::string& key = parameters.keys[k];
    EXPECT_EQ(nlohmann::json(key), of["parameter"]);
    const double sigma = of["sigma"].get<double>();
    EXPECT_NEAR(parameters.sigma[static_cast<Eigen::Index>(k)], sigma, 1e-12 * sigma) << key;
    EXPECT_EQ(parameters.consider[k], key == "beam.damping") << key;
    for (std::size_t j = 0; j < parameters.keys.size(); ++j) {
      const double of_pair = json["correlations"][k][j];
      EXPECT_NEAR(
          parameters.correlation(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)),
          of_pair, 1e-9)
          << key;
      if (of["hides_in"] == parameters.keys[j]) {
        EXPECT_NEAR(of_pair, of["correlation"].get<double>(), 1e-9);
      }
    }
  }
  const Eigen::MatrixXd& correlation = parameters.correlation;
  EXPECT_EQ(correlation, correlation.transpose());
  EXPECT_TRUE(correlation.diagonal().isOnes(0.0));
  EXPECT_TRUE(definiteness(correlation).semidefinite);
  EXPECT_GT(correlation.cwiseAbs().sum(), 1.5 * static_cast<double>(parameters.keys.size()));
  const std::string written = read_text(path("fitted.toml"));
  EXPECT_EQ(written.find("0.125"), std::string::npos) << written;
  EXPECT_EQ(written.find("gone"), std::string::npos) << written;
  EXPECT_NE(written.find("# kept\n"), std::string::npos) << written;
  EXPECT_NE(written.find("[parameters]\n# by identify"), std::string::npos) << written;
  // A second time: the text does not grow.
  ASSERT_EQ(identify({events, path("fitted.toml"), "--output", path("again.toml")}).code, 0);
  const auto lines = [](const std::string& of) { return std::count(of.begin(), of.end(), '\n'); };
  EXPECT_EQ(lines(read_text(path("again.toml"))), lines(written));
}

// JSON: residuals of the used impacts with their expected deviations.
TEST_F(IdentifyProgramTest, ResidualsAreInTheReport) {
  constexpr double jitter = 2e-4;
  const std::string events = events_of(read_text(scene_file("lab_rig")), 40.0, jitter);
  const Ended ended = identify({events, scene_file("lab_rig"), "--jitter", "2e-4", "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = test::parse_json(ended.out);
  const auto& residuals = json["residuals"];
  const std::size_t n = residuals["t"].size();
  ASSERT_LE(n, json["impacts"].get<std::size_t>());
  ASSERT_GT(n, 50U);
  std::vector<double> exact;
  for (const ContactEvent& event : test::events_of(shipped_scene("lab_rig"), 40.0)) {
    exact.push_back(event.t);
  }
  double squares = 0.0, unit_squares = 0.0, along = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double residual = residuals["residual"][k], sigma = residuals["sigma"][k];
    EXPECT_EQ(residuals["contact"][k], 1);
    EXPECT_GT(sigma, 0.0);
    EXPECT_LE(sigma, jitter);
    squares += residual * residual;
    const double t = residuals["t"][k];
    const double from_exact =
        *std::min_element(exact.begin(), exact.end(),
                          [t](double a, double b) { return std::abs(a - t) < std::abs(b - t); });
    along += residual * (t - from_exact);
    unit_squares += residual * residual / (sigma * sigma);
  }
  EXPECT_NEAR(squares / (jitter * jitter), json["chi2"].get<double>(),
              1e-6 * json["chi2"].get<double>());
  EXPECT_GT(along, 0.5 * squares) << "measured minus fitted";
  const auto count = static_cast<double>(n);
  EXPECT_NEAR(unit_squares / count, 1.0, 4.0 * std::sqrt(2.0 / count));
}

// A factor is 1 in the written scene, and its sigma is relative to the new value.
TEST_F(IdentifyProgramTest, DeviationsOfFactorsAreRelativeToTheNewValue) {
  const std::string text = read_text(scene_file("non_proportional"));
  Scene real = parse_scene(text, "real.toml");
  real.model.K *= 1.1;
  write_events(test::events_of(real, 40.0));
  const Ended ended =
      identify({path("events.csv"), scene_file("non_proportional"), "--free",
                "system.K,impact.restitution", "--output", path("fitted.toml"), "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = test::parse_json(ended.out);
  const ParameterUncertainty parameters = read_scene(path("fitted.toml")).prior.parameters;
  ASSERT_EQ(parameters.keys, (std::vector<std::string>{"system.K", "impact.restitution"}));
  EXPECT_NEAR(json["parameters"][0]["value"].get<double>(), 1.1, 1e-6);
  EXPECT_NEAR(parameters.sigma[0] / json["parameters"][0]["sigma"].get<double>(), 1.0 / 1.1, 1e-6);
  EXPECT_NEAR(parameters.sigma[1] / json["parameters"][1]["sigma"].get<double>(), 1.0, 1e-9);
}

std::vector<std::string> keys_of(const std::vector<Parameter>& unknowns) {
  std::vector<std::string> keys;
  for (const Parameter& unknown : unknowns) keys.push_back(unknown.key);
  return keys;
}

TEST(IdentifyOptions, FixOneParameterForTheScale) {
  const Scene rig = shipped_scene("lab_rig");
  const auto usual = sought(rig, {});
  EXPECT_EQ(keys_of(usual), (std::vector<std::string>{"impact.restitution", "system.C", "system.K",
                                                      "contact.1.clearance", "force.1.frequency",
                                                      "force.1.phase"}));
  EXPECT_EQ(held_for_scale(rig, usual), "force.1.amplitude");
  const auto by_clearance =
      sought(rig, request_of(rig, {.free = "", .known = "contact.1.clearance", .within = ""}));
  EXPECT_EQ(held_for_scale(rig, by_clearance), "contact.1.clearance");
  EXPECT_EQ(by_clearance.size(), usual.size());
  const auto one =
      sought(rig, request_of(rig, {.free = "system.K", .known = "", .within = "0.5,system.K=0.1"}));
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(one[0].within, 0.1);
  EXPECT_EQ(held_for_scale(rig, one), "");
  EXPECT_EQ(sought(rig, request_of(rig, {.free = "all", .known = "", .within = "0.5"}))[2].within,
            0.5);
  EXPECT_THROW(request_of(rig, {.free = "beam.damping", .known = "", .within = ""}), UsageError);
  EXPECT_THROW(request_of(rig, {.free = "", .known = "", .within = "11"}), UsageError);
  EXPECT_THROW(request_of(rig, {.free = "system.K", .known = "system.K", .within = ""}),
               UsageError);
}

}  // namespace
}  // namespace sprag
