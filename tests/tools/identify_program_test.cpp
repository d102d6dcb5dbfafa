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

  /// Events of a scene text, as a CSV.
  std::string events_of(const std::string& text, double duration, double jitter = 0.0) {
    std::mt19937_64 engine(5);
    std::normal_distribution<double> normal;
    EventsWriter writer(path("events.csv"));
    for (ContactEvent event : test::events_of(parse_scene(text, "real.toml"), duration)) {
      event.t += jitter > 0.0 ? jitter * normal(engine) : 0.0;
      writer.write(event);
    }
    EXPECT_TRUE(writer.close());
    return path("events.csv");
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
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_EQ(report["fits"], true);
  EXPECT_EQ(report["exit"], 0);
  ASSERT_EQ(report["simplest"].size(), 1U);
  EXPECT_EQ(report["simplest"][0][0]["parameter"], "impact.restitution");
  EXPECT_EQ(report["parameters"].size(), 7U);

  const std::string fitted = read_text(path("fitted.toml"));
  EXPECT_NE(fitted.find("# l [m]"), std::string::npos);
  const Scene scene = read_scene(path("fitted.toml"));
  EXPECT_NEAR(scene.model.contacts[0].restitution, 0.65, 1e-10);
  EXPECT_NEAR(scene.beam->damping, 0.17, 1e-10);
  EXPECT_NEAR(scene.positions[0], 0.868, 1e-10);
  EXPECT_NEAR(scene.prior.start.q[0], -0.05, 1e-9);
  EXPECT_NEAR(scene.truth.start.q[0], -0.05, 1e-9);
  EXPECT_EQ(scene.prior.jitter, 0.0);
  // The written scene explains the events without changes.
  const Ended again = identify({events, path("fitted.toml"), "--json"});
  EXPECT_EQ(again.code, 0);
  const auto json = nlohmann::json::parse(again.out);
  ASSERT_EQ(json["simplest"].size(), 1U);
  EXPECT_TRUE(json["simplest"][0].empty()) << again.out;
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
        Case{"lab_rig", "[-600.0, 600.0]]", "[-600.0, 620.0]]", "system.K.2.2", 20.0},
        Case{"two_stops_beam", "clearance = 0.05", "clearance = 0.052",
             "contact.2.clearance,contact.1.restitution", 6.0}}) {
    const std::string text = read_text(scene_file(of.scene));
    const std::string events = events_of(replaced(text, of.what, of.by), of.duration);
    Arguments arguments{events, scene_file(of.scene), "--output", path("fitted.toml")};
    if (*of.free != '\0') arguments.insert(arguments.end(), {"--free", of.free});
    const Ended ended = identify(arguments);
    EXPECT_EQ(ended.code, 0) << of.scene << ended.out << ended.err;
    const Scene fitted = read_scene(path("fitted.toml"));
    const Scene real = parse_scene(replaced(text, of.what, of.by), "real.toml");
    EXPECT_LT((fitted.model.K - real.model.K).norm(), 1e-7 * real.model.K.norm()) << of.scene;
    EXPECT_LT((fitted.model.C - real.model.C).norm(), 1e-7 * real.model.C.norm()) << of.scene;
    for (std::size_t j = 0; j < real.model.forces.size(); ++j) {
      EXPECT_NEAR(value(fitted.model.forces[j].harmonic, 1.0),
                  value(real.model.forces[j].harmonic, 1.0), 1e-7)
          << of.scene;
    }
    for (std::size_t i = 0; i < real.model.contacts.size(); ++i) {
      EXPECT_NEAR(fitted.model.contacts[i].clearance, real.model.contacts[i].clearance, 1e-8);
      EXPECT_NEAR(fitted.model.contacts[i].restitution, real.model.contacts[i].restitution, 1e-8);
    }
  }
}

// A record of a clock that is fast. The written scene has the clock, and explains the record.
TEST_F(IdentifyProgramTest, AFastContactClockIsNamedAndWritten) {
  struct Case {
    const char* scene;
    const char* free;
    double duration, jitter, rate, offset;
  };
  for (const Case& of :
       {Case{"paper_beam", "clock.rate,impact.restitution", 60.0, 1e-4, 1.0002, 0.0},
        Case{"lab_rig", "clock.rate,clock.offset", 15.0, 1e-5, 0.9997, 0.004},
        Case{"two_stops_beam", "clock.rate", 6.0, 1e-6, 1.0002, 0.0}}) {
    const std::string text = read_text(scene_file(of.scene));
    const std::string events = path("clock.csv");
    std::mt19937_64 engine(7);
    std::normal_distribution<double> normal;
    EventsWriter writer(events);
    double last = 0.0;
    for (ContactEvent event : test::events_of(parse_scene(text, "real.toml"), of.duration)) {
      event.t = last = std::max(last, of.offset + of.rate * event.t + of.jitter * normal(engine));
      writer.write(event);
    }
    ASSERT_TRUE(writer.close());
    const std::string jitter = std::to_string(1e6 * of.jitter) + "e-6";
    const Ended ended = identify({events, scene_file(of.scene), "--jitter", jitter, "--free",
                                  of.free, "--output", path("fitted.toml"), "--events",
                                  path("mended.csv"), "--report", path("report.json")});
    ASSERT_EQ(ended.code, 0) << of.scene << ended.out << ended.err;
    EXPECT_NE(ended.err.find("clock.rate is not listed in [parameters]"), std::string::npos);
    const auto report = nlohmann::json::parse(read_text(path("report.json")));
    EXPECT_TRUE(report["clock_ambiguities"].empty());
    for (const auto& parameter : report["parameters"]) {
      const double real = parameter["parameter"] == "clock.rate"     ? of.rate
                          : parameter["parameter"] == "clock.offset" ? of.offset
                                                                     : 0.7;
      EXPECT_TRUE(parameter["determined"]) << parameter;
      EXPECT_LT(std::abs(parameter["value"].get<double>() - real),
                4.5 * parameter["sigma"].get<double>())
          << of.scene << parameter;
    }
    const Scene fitted = read_scene(path("fitted.toml"));
    EXPECT_NEAR(fitted.clock.rate, of.rate, 3e-5) << of.scene;
    EXPECT_NEAR(fitted.clock.offset, of.offset, 1e-3) << of.scene;
    EXPECT_EQ(fitted.model.K, parse_scene(text, "real.toml").model.K);
    // The mended events are on the clock of the record.
    const auto mended = read_events(path("mended.csv"), 2).events;
    const auto recorded = read_events(events, 2).events;
    ASSERT_EQ(mended.size(), recorded.size());
    EXPECT_NEAR(mended.back().t, recorded.back().t, 1e-12 * recorded.back().t);
    const Ended again = identify({events, path("fitted.toml"), "--jitter", jitter, "--json"});
    EXPECT_EQ(again.code, 0) << again.out;
    const auto json = nlohmann::json::parse(again.out);
    ASSERT_EQ(json["simplest"].size(), 1U) << again.out;
    EXPECT_TRUE(json["simplest"][0].empty()) << again.out;
  }
}

TEST_F(IdentifyProgramTest, AFastContactClockIsTheSingleCause) {
  const std::string beam = scene_file("paper_beam");
  EventsWriter writer(path("clock.csv"));
  std::mt19937_64 engine(7);
  std::normal_distribution<double> normal;
  for (ContactEvent event : test::events_of(shipped_scene("paper_beam"), 60.0)) {
    event.t = 1.0002 * event.t + 1e-4 * normal(engine);
    writer.write(event);
  }
  ASSERT_TRUE(writer.close());
  const Ended ended = identify({path("clock.csv"), beam, "--jitter", "1e-4"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("A contact clock that is "), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find(" ppm fast (clock.rate 1.000"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("instead of 1) alone explains the events."), std::string::npos)
      << ended.out;

  // A change of all that has a time is the same.
  const Ended all =
      identify({path("clock.csv"), beam, "--jitter", "1e-4", "--free",
                "clock.rate,beam.damping,beam.bending_stiffness,excitation.frequency", "--json"});
  EXPECT_EQ(all.code, 0) << all.err;
  const auto json = nlohmann::json::parse(all.out);
  EXPECT_EQ(json["parameters"].back()["parameter"], "clock.rate");
  EXPECT_EQ(json["parameters"].back()["determined"], false);
  EXPECT_TRUE(json["parameters"].back()["value"].is_null());
  ASSERT_EQ(json["clock_ambiguities"].size(), 1U);
  EXPECT_EQ(json["clock_ambiguities"][0]["equals"].size(), 3U);
  const Ended text =
      identify({path("clock.csv"), beam, "--jitter", "1e-4", "--free",
                "clock.rate,beam.damping,beam.bending_stiffness,excitation.frequency"});
  EXPECT_NE(text.out.find("clock.rate is not determined: the same event times follow from a change "
                          "of beam.bending_stiffness, beam.damping and excitation.frequency "
                          "together. Hold one of them: leave it out of --free."),
            std::string::npos)
      << text.out;
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
  EventsWriter writer(path("events.csv"));
  for (const ContactEvent& event : test::events_of(real, 15.0)) writer.write(event);
  ASSERT_TRUE(writer.close());
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

TEST_F(IdentifyProgramTest, ALogAndAJitter) {
  const Scene beam = shipped_scene("paper_beam");
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal;
  auto events = test::events_of(beam, 60.0);
  for (ContactEvent& event : events) event.t += 1e-4 * normal(engine);
  write_contact_log(path("run.lcmlog"), events, 1, 60.0, std::nullopt);
  const Ended found = identify({path("run.lcmlog"), scene_file("paper_beam"), "--within", "0.1",
                                "--json", "--output", path("fitted.toml")});
  ASSERT_EQ(found.code, 0) << found.err;
  const auto json = nlohmann::json::parse(found.out);
  EXPECT_NEAR(json["jitter"].get<double>(), 1e-4, 3e-5);
  EXPECT_EQ(json["jitter_told"], false);
  EXPECT_NEAR(read_scene(path("fitted.toml")).prior.jitter, 1e-4, 3e-5);
  const Ended given = identify({path("run.lcmlog"), scene_file("paper_beam"), "--jitter", "1e-6",
                                "--within", "0.1", "--free", "impact.restitution"});
  EXPECT_EQ(given.code, 3) << given.out;
  EXPECT_NE(given.out.find("no fit"), std::string::npos) << given.out;
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
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_GE(report["stretches"], 2);
  EXPECT_GT(report["impacts"], 200);
  EXPECT_GT(report["to"], 200.0);
  EXPECT_NEAR(report["parameters"][0]["value"].get<double>(), 0.65, 1e-9);
}

// Jittered times that are sorted afterwards contradict each other at the end of a chatter: a
// sustained contact looks like an impact, and the next impact like a sustained contact.
TEST_F(IdentifyProgramTest, ContradictoryEventsAreExcluded) {
  const std::string chatter = scene_file("paper_beam_chatter");
  std::mt19937_64 engine(5);
  std::normal_distribution<double> normal;
  auto events = test::events_of(shipped_scene("paper_beam_chatter"), 60.0);
  for (ContactEvent& event : events) event.t += 1e-4 * normal(engine);
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  EventsWriter writer(path("sorted.csv"));
  for (const ContactEvent& event : events) writer.write(event);
  ASSERT_TRUE(writer.close());
  const Ended ended =
      identify({path("sorted.csv"), chatter, "--free", "all", "--report", path("report.json")});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.err.find("closes, but is closed already"), std::string::npos) << ended.err;
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  EXPECT_NEAR(report["jitter"].get<double>(), 1e-4, 2e-5);
  for (const auto& parameter : report["parameters"]) {
    if (!parameter["told"]) continue;
    const double off = parameter["value"].get<double>() - parameter["nominal"].get<double>();
    EXPECT_LT(std::abs(off), 4.5 * parameter["sigma"].get<double>()) << parameter.dump();
  }
}

TEST_F(IdentifyProgramTest, DriftIsReportedAndWritten) {
  const Scene beam = shipped_scene("paper_beam");
  EventsWriter writer(path("events.csv"));
  for (const ContactEvent& event :
       identification_study::drifting_events(beam, 1e-8, 1e-4, 60.0, 0.05, 1)) {
    writer.write(event);
  }
  ASSERT_TRUE(writer.close());
  const Arguments arguments{
      path("events.csv"), scene_file("paper_beam"), "--within", "0.05", "--accept",
      "--output",         path("fitted.toml")};
  const Ended found = identify(arguments);
  ASSERT_EQ(found.code, 0) << found.out << found.err;
  EXPECT_NE(found.out.find("The machine drifts from its model: drift "), std::string::npos)
      << found.out;
  const Scene fitted = read_scene(path("fitted.toml"));
  EXPECT_GT(fitted.prior.drift, 3e-9);
  EXPECT_LT(fitted.prior.drift, 3e-8);
  EXPECT_NEAR(fitted.prior.jitter, 1e-4, 4e-5);
  const Ended again = identify({path("events.csv"), scene_file("paper_beam"), "--within", "0.05",
                                "--duration", "30", "--json"});
  const auto json = nlohmann::json::parse(again.out);
  EXPECT_EQ(json["drift"]["found"], true) << again.out;
}

TEST_F(IdentifyProgramTest, MisfitIsRefusedUnlessAccepted) {
  const std::string text = read_text(scene_file("paper_beam"));
  const std::string events = events_of(replaced(text, "modes = 3", "modes = 4"), 60.0);
  const Ended refused =
      identify({events, scene_file("paper_beam"), "--free", "beam.bending_stiffness,beam.damping",
                "--within", "0.1", "--output", path("fitted.toml")});
  EXPECT_EQ(refused.code, 3) << refused.out;
  EXPECT_NE(refused.out.find("paper_beam: no fit"), std::string::npos) << refused.out;
  EXPECT_FALSE(std::filesystem::exists(path("fitted.toml")));
  EXPECT_NE(refused.err.find("fitted.toml is not written: the events do not fit"),
            std::string::npos)
      << refused.err;
  const Ended taken =
      identify({events, scene_file("paper_beam"), "--free", "beam.bending_stiffness,beam.damping",
                "--within", "0.1", "--accept", "--output", path("fitted.toml")});
  EXPECT_EQ(taken.code, 0) << taken.out;
  EXPECT_GT(read_scene(path("fitted.toml")).prior.jitter, 1e-3);
}

// The jitter that was given and the scatter that was found are both printed.
TEST_F(IdentifyProgramTest, AnAcceptedMisfitKeepsTheSpecifiedJitter) {
  const std::string text = read_text(scene_file("paper_beam"));
  const std::string events = events_of(replaced(text, "modes = 3", "modes = 4"), 60.0);
  const Ended taken =
      identify({events, scene_file("paper_beam"), "--free", "beam.damping", "--jitter", "1e-5",
                "--accept", "--output", path("fitted.toml"), "--report", path("report.json")});
  ASSERT_EQ(taken.code, 0) << taken.out << taken.err;
  const auto report = nlohmann::json::parse(read_text(path("report.json")));
  const double scatter = report["scatter"];
  EXPECT_EQ(report["jitter"], 1e-5);
  EXPECT_GT(scatter, 1e-3);
  const std::string found = short_number(scatter, 3);
  EXPECT_NE(taken.out.find("jitter 1e-05 s as specified, scatter " + found + " s as found."),
            std::string::npos)
      << taken.out;
  EXPECT_EQ(read_scene(path("fitted.toml")).prior.jitter, scatter);
}

// --within is relative to the scene's value.
TEST_F(IdentifyProgramTest, AValueBeyondWithinIsRefused) {
  Scene real = shipped_scene("lab_rig");
  real.model.C *= 1.24;
  EventsWriter writer(path("events.csv"));
  for (const ContactEvent& event : test::events_of(real, 20.0)) writer.write(event);
  ASSERT_TRUE(writer.close());
  const Arguments arguments{path("events.csv"), scene_file("lab_rig"), "--free",
                            "impact.restitution,system.C", "--json"};
  const Ended refused = identify(arguments);
  EXPECT_EQ(refused.code, 3) << refused.out;
  EXPECT_EQ(nlohmann::json::parse(refused.out)["problem"], "bound_reached") << refused.out;
  Arguments wider = arguments;
  wider.insert(wider.end(), {"--within", "0.25"});
  const Ended found = identify(wider);
  ASSERT_EQ(found.code, 0) << found.out;
  EXPECT_NEAR(nlohmann::json::parse(found.out)["parameters"][1]["value"].get<double>(), 1.24, 1e-6);
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

constexpr const char* ball = R"([system]
M = [[1.0]]
C = [[0.15]]
K = [[0.0]]
[[force]]
direction = [1.0]
constant = -9.81
[impact]
law = "newton"
restitution = 0.95
[[contact]]
direction = [1.0]
[master]
q = [0.3]
[replica]
q = [0.2]
)";

// An impact is lost: it is in the mended events, which other programs read.
TEST_F(IdentifyProgramTest, RepairedEventsAreWritten) {
  write_text(path("ball.toml"), ball);
  const std::string text = read_text(events_of(ball, 4.0, 1e-4));
  std::vector<std::string> rows;
  for (std::size_t at = 0; at < text.size();) {
    const auto end = text.find('\n', at) + 1;
    rows.push_back(text.substr(at, end - at));
    at = end;
  }
  ASSERT_GT(rows.size(), 20U);
  const double lost = std::stod(rows[11]);
  rows.erase(rows.begin() + 11, rows.begin() + 13);
  std::string without;
  for (const std::string& row : rows) without += row;
  write_text(path("lost.csv"), without);
  const Ended ended =
      identify({path("lost.csv"), path("ball.toml"), "--free", "impact.restitution", "--events",
                path("mended.csv"), "--output", path("fitted.toml"), "--no-drift-limit", "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = nlohmann::json::parse(ended.out);
  ASSERT_EQ(json["missing"].size(), 1U);
  EXPECT_NEAR(json["missing"][0]["t"].get<double>(), lost, 2e-3);
  const std::string mended = read_text(path("mended.csv"));
  EXPECT_EQ(mended.substr(0, mended.find('\n')), "t,contact,closed,note");
  EXPECT_NE(mended.find(",1,1,lost\n"), std::string::npos) << mended;
  EXPECT_EQ(read_events(path("mended.csv"), 1).events.size(), (rows.size() - 1) / 2 + 1);
  EXPECT_EQ(read_scene(path("fitted.toml")).prior.drift, 0.0);
  const Ended again =
      identify({path("mended.csv"), path("fitted.toml"), "--free", "impact.restitution", "--json"});
  EXPECT_EQ(again.code, 0) << again.out;
  EXPECT_TRUE(nlohmann::json::parse(again.out)["missing"].empty());
}

// A parameter that is not determined has no value and is not written.
TEST_F(IdentifyProgramTest, UndeterminedParametersAreNotWritten) {
  const std::string oscillator = scene_file("impact_oscillator");
  const std::string events = events_of(read_text(oscillator), 30.0, 1e-4);
  const Ended ended =
      identify({events, oscillator, "--jitter", "1e-4", "--output", path("fitted.toml"), "--json"});
  const auto json = nlohmann::json::parse(ended.out);
  int undetermined = 0;
  for (const auto& of : json["parameters"]) {
    if (of["determined"] == true) continue;
    ++undetermined;
    EXPECT_TRUE(of["value"].is_null());
    EXPECT_TRUE(of["sigma"].is_null());
  }
  EXPECT_GT(undetermined, 0) << ended.out;
  if (ended.code == 0) {
    const auto listed = read_scene(path("fitted.toml")).prior.parameters.keys.size();
    EXPECT_EQ(listed + static_cast<std::size_t>(undetermined), json["parameters"].size());
  }
  EXPECT_EQ(ended.code == 0, json["fits"] == true);
  EXPECT_EQ(std::filesystem::exists(path("fitted.toml")), ended.code == 0);
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
  const auto json = nlohmann::json::parse(ended.out);
  ASSERT_EQ(parameters.keys.size(), json["parameters"].size());
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const auto& of = json["parameters"][k];
    const std::string& key = parameters.keys[k];
    EXPECT_EQ(nlohmann::json(key), of["parameter"]);
    const double sigma = of["sigma"].get<double>();
    EXPECT_NEAR(parameters.sigma[static_cast<Eigen::Index>(k)], sigma, 1e-12 * sigma) << key;
    EXPECT_EQ(parameters.consider[k], key == "beam.damping") << key;
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

// The written correlation of a parameter with its partner is that of the report.
TEST(FittedText, CorrelationsEqualThoseOfTheFit) {
  const std::string text = read_text(scene_file("paper_beam"));
  const Scene scene = read_scene(scene_file("paper_beam"));
  const std::vector<ContactEvent> events = test::events_of(scene, 60.0);
  IdentificationSettings settings;
  settings.unknowns = sought(scene, {});
  const Identification fit = sprag::identify(scene, events, settings);
  ASSERT_TRUE(fit.fits());
  const std::string fitted = fitted_text(text, scene, fit, "in.toml", "out.toml");
  const ParameterUncertainty parameters = parse_scene(fitted, "out.toml").prior.parameters;
  ASSERT_EQ(parameters.keys.size(), fit.unknowns.size());
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const FittedUnknown& of = fit.unknowns[k];
    ASSERT_GE(of.partner, 0);
    EXPECT_NEAR(parameters.correlation(static_cast<Eigen::Index>(k), of.partner), of.correlation,
                1e-9)
        << of.unknown.key;
  }
}

// JSON: residuals of the used impacts with their expected deviations, and all correlations.
TEST_F(IdentifyProgramTest, ResidualsAndCorrelationsAreInTheReport) {
  constexpr double jitter = 2e-4;
  const std::string events = events_of(read_text(scene_file("lab_rig")), 40.0, jitter);
  const Ended ended = identify({events, scene_file("lab_rig"), "--jitter", "2e-4", "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = nlohmann::json::parse(ended.out);
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

  const auto& rows = json["correlations"];
  const auto& parameters = json["parameters"];
  ASSERT_EQ(rows.size(), parameters.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), rows.size());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      EXPECT_EQ(rows[i][k], rows[k][i]);
      const bool both = parameters[i]["determined"] == true && parameters[k]["determined"] == true;
      EXPECT_TRUE(both || rows[i][k].is_null());
      if (i == k && both) {
        EXPECT_EQ(rows[i][k], 1.0);
      }
      if (parameters[i]["hides_in"] == parameters[k]["parameter"]) {
        EXPECT_NEAR(rows[i][k].get<double>(), parameters[i]["correlation"].get<double>(), 1e-9);
      }
    }
  }
}

// A factor is 1 in the written scene, and its sigma is relative to the new value.
TEST_F(IdentifyProgramTest, DeviationsOfFactorsAreRelativeToTheNewValue) {
  const std::string text = read_text(scene_file("non_proportional"));
  Scene real = parse_scene(text, "real.toml");
  real.model.K *= 1.1;
  EventsWriter writer(path("events.csv"));
  for (const ContactEvent& event : test::events_of(real, 40.0)) writer.write(event);
  ASSERT_TRUE(writer.close());
  const Ended ended =
      identify({path("events.csv"), scene_file("non_proportional"), "--free",
                "system.K,impact.restitution", "--output", path("fitted.toml"), "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = nlohmann::json::parse(ended.out);
  const ParameterUncertainty parameters = read_scene(path("fitted.toml")).prior.parameters;
  ASSERT_EQ(parameters.keys, (std::vector<std::string>{"system.K", "impact.restitution"}));
  EXPECT_NEAR(json["parameters"][0]["value"].get<double>(), 1.1, 1e-6);
  EXPECT_NEAR(parameters.sigma[0] / json["parameters"][0]["sigma"].get<double>(), 1.0 / 1.1, 1e-6);
  EXPECT_NEAR(parameters.sigma[1] / json["parameters"][1]["sigma"].get<double>(), 1.0, 1e-9);
}

TEST_F(IdentifyProgramTest, SingleEntriesAreListed) {
  const std::string text = read_text(scene_file("lab_rig"));
  const std::string events =
      events_of(replaced(text, "[-600.0, 600.0]]", "[-600.0, 620.0]]"), 20.0);
  const Ended ended =
      identify({events, scene_file("lab_rig"), "--free", "system.K.2.2,impact.restitution",
                "--output", path("fitted.toml")});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_EQ(read_scene(path("fitted.toml")).prior.parameters.keys,
            (std::vector<std::string>{"system.K.2.2", "impact.restitution"}));
  EXPECT_EQ(ended.err.find("is not listed"), std::string::npos) << ended.err;
}

std::vector<std::string> keys_of(const std::vector<Unknown>& unknowns) {
  std::vector<std::string> keys;
  for (const Unknown& unknown : unknowns) keys.push_back(unknown.key);
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
