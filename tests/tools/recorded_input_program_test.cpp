// The programs with a recorded input: from the shipped scene to estimates, and what they refuse.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sprag/scene_file.h"
#include "tests/support/program_test.h"

namespace sprag {
namespace {

using test::Arguments;
using test::operator+;  // NOLINT(misc-unused-using-decls): used by operators
using test::read_text;
using test::write_text;

class RecordedInputPrograms : public test::ProgramTest {
 protected:
  const std::string scene_ = SPRAG_SOURCE_DIR "/scenes/swept_beam.toml";

  void expect_refused(const std::string& program, const Arguments& arguments,
                      const std::string& message) {
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(message), std::string::npos) << ended.err;
  }

  // The shipped scene with more keys in [excitation] and a jitter.
  std::string copy(const std::string& keys) const {
    std::string text = read_text(scene_);
    const std::string line = "interpolation = \"spline\"";
    text.replace(text.find(line), line.size(), line + "\n" + keys);
    const std::string record = "\"records/swept_base.csv\"";
    text.replace(text.find(record), record.size(),
                 "\"" SPRAG_SOURCE_DIR "/scenes/records/swept_base.csv\"");
    return write_text(path("copy.toml"), text + "\n[events]\njitter = 1e-5\n");
  }

  void simulate(const std::string& scene) {
    const Ended ended =
        run(MASTER_SIM, {scene, "--duration", "6", "--speed", "max", "--no-lcm", "--tick", "0.01",
                         "--events", path("events.csv"), "--states", path("machine.csv")});
    ASSERT_EQ(ended.code, 0) << ended.err;
  }
};

TEST_F(RecordedInputPrograms, AllOtherProgramsAcceptARecord) {
  simulate(scene_);
  const std::string uncertain =
      write_text(path("uncertain.toml"),
                 read_text(copy("")) + "[parameters]\nexcitation.delay = { sigma = 1e-4 }\n");
  const Arguments how{"--replay", path("events.csv"), "--duration", "6", "--tick", "0.01"};
  for (const Arguments& more :
       {Arguments{scene_, "--estimator", "replica"}, Arguments{scene_, "--estimator", "adaptive"},
        Arguments{uncertain}, Arguments{copy(""), "--smooth", "--states", path("s.csv")}}) {
    const Ended ended = run(OBSERVER, more + how);
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
  EXPECT_NE(run(CHECK_SCENE, {scene_}).code, 2);
  const Ended diagnosis = run(DIAGNOSE, {path("events.csv"), scene_, "--duration", "1"});
  EXPECT_EQ(diagnosis.code, 0) << diagnosis.err;
  EXPECT_NE(diagnosis.out.find("excitation.delay"), std::string::npos) << diagnosis.out;
}

TEST_F(RecordedInputPrograms, ARunBeyondTheRecordIsRefused) {
  const std::string ends = "the recorded input of swept_beam ends";
  const std::string most =
      ends +
      " at t = 6; --duration must be at most 6, or the table with the key `file` must have outside";
  const Arguments how{"--duration", "7", "--speed", "max", "--no-lcm"};
  expect_refused(MASTER_SIM, Arguments{scene_} + how, most);
  const Arguments held{copy("outside = \"hold\""), "--events", path("events.csv")};
  ASSERT_EQ(run(MASTER_SIM, held + how).code, 0);
  expect_refused(OBSERVER, {scene_, "--replay", path("events.csv"), "--duration", "7"}, most);
  expect_refused(IDENTIFY, {path("events.csv"), scene_}, ends);
}

// Without --duration a replay ends with the events, and they may end before the input does.
TEST_F(RecordedInputPrograms, AReplayReportsTheEndOfTheInputOnlyIfItGoesBeyond) {
  const std::string ends = "the recorded input ends at t = 6; after it the observer holds";
  for (const Arguments& how : {Arguments{}, Arguments{"--smooth", "--states", path("s.csv")}}) {
    for (const char* duration : {"5.5", "7"}) {
      ASSERT_EQ(run(MASTER_SIM, {copy("outside = \"hold\""), "--duration", duration, "--speed",
                                 "max", "--no-lcm", "--events", path("events.csv")})
                    .code,
                0);
      const Ended ended = run(
          OBSERVER, Arguments{copy(""), "--replay", path("events.csv"), "--tick", "0.01"} + how);
      EXPECT_EQ(ended.code, 0) << ended.err;
      EXPECT_EQ(ended.err.find(ends) != std::string::npos, duration == std::string("7"))
          << ended.err;
    }
  }
}

TEST_F(RecordedInputPrograms, GainAndDelayAreIdentified) {
  // The machine: a sensor that shows 20 % too little, half a sample of 2 ms too early.
  simulate(copy("gain = 1.25\ndelay = 0.001\noutside = \"hold\""));
  const std::string given = copy("outside = \"hold\"");
  const Ended ended =
      run(IDENTIFY, {path("events.csv"), given, "--free", "excitation.gain,excitation.delay",
                     "--within", "excitation.gain=0.3", "--output", path("fitted.toml"), "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = test::parse_json(ended.out);
  const auto& found = json["parameters"];
  EXPECT_NEAR(found[0]["value"].get<double>(), 1.25, 0.02);
  EXPECT_NEAR(found[1]["value"].get<double>(), 0.001, 0.05 * 0.001);
  EXPECT_FALSE(json["record"]["limits"].is_null());
  // The fitted scene holds both keys and can be read.
  const Scene fitted = read_scene(path("fitted.toml"));
  const SampledInput::Settings& settings = fitted.model.forces[0].input->settings();
  EXPECT_EQ(settings.gain, found[0]["value"].get<double>());
  EXPECT_EQ(settings.delay, found[1]["value"].get<double>());
  // And their deviations, for a filter.
  const ParameterUncertainty& uncertain = fitted.prior.parameters;
  ASSERT_EQ(uncertain.keys, (std::vector<std::string>{"excitation.gain", "excitation.delay"}));
  EXPECT_NEAR(uncertain.sigma[0], found[0]["sigma"].get<double>(), 1e-6 * uncertain.sigma[0]);
  const Ended observed = run(OBSERVER, {path("fitted.toml"), "--replay", path("events.csv"),
                                        "--duration", "6", "--tick", "0.01"});
  EXPECT_EQ(observed.code, 0) << observed.err;
  EXPECT_NE(observed.err.find("excitation.delay"), std::string::npos) << observed.err;
}

}  // namespace
}  // namespace sprag
