// The programs with a recorded input: from the shipped scene to estimates, and what they refuse.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "sprag/detail/files/states_file.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"

namespace sprag {
namespace {

using test::Arguments;
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

TEST_F(RecordedInputPrograms, TheShippedScenesStateIsReconstructed) {
  simulate(scene_);
  const Ended ended = run(OBSERVER, {scene_, "--replay", path("events.csv"), "--duration", "6",
                                     "--tick", "0.01", "--states", path("estimate.csv")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const auto machine = read_text(path("machine.csv"));
  const auto estimate = read_text(path("estimate.csv"));
  const auto last_row = [](const std::string& text) {
    return text.substr(text.find_last_of('\n', text.size() - 2) + 1);
  };
  // k, t, q1, ...: the first coordinate of both files.
  const auto q1 = [&](const std::string& text) {
    std::string row = last_row(text);
    for (int i = 0; i < 2; ++i) row.erase(0, row.find(',') + 1);
    return std::stod(row);
  };
  EXPECT_NEAR(q1(estimate), q1(machine), 1e-6 * std::max(1e-3, std::abs(q1(machine))));
  EXPECT_GT(std::count(machine.begin(), machine.end(), '\n'), 600);
}

TEST_F(RecordedInputPrograms, AllOtherProgramsAcceptARecord) {
  simulate(scene_);
  for (const char* estimator : {"replica", "timing", "both", "adaptive"}) {
    const Ended ended = run(OBSERVER, {scene_, "--replay", path("events.csv"), "--duration", "6",
                                       "--tick", "0.01", "--estimator", estimator});
    EXPECT_EQ(ended.code, 0) << estimator << ": " << ended.err;
  }
  const Ended smooth = run(OBSERVER, {copy(""), "--replay", path("events.csv"), "--duration", "6",
                                      "--tick", "0.01", "--smooth", "--states", path("s.csv")});
  EXPECT_EQ(smooth.code, 0) << smooth.err;
  const Ended check = run(CHECK_SCENE, {scene_});
  EXPECT_NE(check.code, 2) << check.err;
}

TEST_F(RecordedInputPrograms, ARunBeyondTheRecordIsRefused) {
  const std::string ends =
      "the recorded input of swept_beam ends at t = 6; --duration must be at "
      "most 6, or the table with the key `file` must have outside";
  expect_refused(MASTER_SIM, {scene_, "--duration", "7", "--speed", "max", "--no-lcm"}, ends);
  simulate(scene_);
  expect_refused(OBSERVER, {scene_, "--replay", path("events.csv"), "--duration", "7"}, ends);
}

// The parameters of [parameters] and [adapt] may be those of the record.
TEST_F(RecordedInputPrograms, AFilterEstimatesParametersUnderARecord) {
  simulate(copy(""));
  const std::string keys =
      "[parameters]\nimpact.restitution = { sigma = 0.002 }\nexcitation.delay = { sigma = 1e-4 }\n";
  const std::string text = read_text(copy(""));
  const std::string given = write_text(path("uncertain.toml"), text + keys);
  const Ended ended = run(OBSERVER, {given, "--replay", path("events.csv"), "--duration", "6",
                                     "--tick", "0.01", "--states", path("estimate.csv")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Scene scene = read_scene(given);
  ASSERT_EQ(scene.prior.parameters.keys.size(), 2U);
}

TEST_F(RecordedInputPrograms, DiagnoseAcceptsARecord) {
  simulate(scene_);
  const Ended ended = run(DIAGNOSE, {path("events.csv"), scene_, "--duration", "2"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("events fit the model"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("excitation.delay"), std::string::npos) << ended.out;
  EXPECT_EQ(ended.out.find("clock rate"), std::string::npos) << ended.out;
}

TEST_F(RecordedInputPrograms, GainAndDelayAreIdentified) {
  // The machine: a sensor that shows 20 % too little, half a sample of 2 ms too early.
  simulate(copy("gain = 1.25\ndelay = 0.001\noutside = \"hold\""));
  const std::string given = copy("outside = \"hold\"");
  const Ended ended =
      run(IDENTIFY, {path("events.csv"), given, "--free", "excitation.gain,excitation.delay",
                     "--within", "excitation.gain=0.3", "--output", path("fitted.toml"), "--json"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const auto json = nlohmann::json::parse(ended.out);
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

TEST_F(RecordedInputPrograms, IdentifyRefusesEventsAfterTheRecord) {
  const std::string held = copy("outside = \"hold\"");
  const Ended ended = run(MASTER_SIM, {held, "--duration", "7", "--speed", "max", "--no-lcm",
                                       "--events", path("events.csv")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  expect_refused(IDENTIFY, {path("events.csv"), scene_}, "the recorded input of swept_beam ends");
}

}  // namespace
}  // namespace sprag
