// reduce with the other programs: a beam of 20 modes is recorded, reduced, and observed with the
// result.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "lcmtypes/contact_log.h"
#include "recording/recorded_events.h"
#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::Arguments;
using test::operator+;
using test::read_text;
using test::write_text;

class ReduceProgramTest : public test::ProgramTest {
 protected:
  Ended reduce(const Arguments& arguments) { return run(REDUCE, arguments); }

  /// The stiff beam with stiffness-proportional damping.
  std::string scene() const {
    std::string text = read_text(SPRAG_SOURCE_DIR "/scenes/stiff_beam.toml");
    std::string ratios;
    for (int i = 1; i <= 20; ++i) {
      const double ratio = wavenumber(i) / wavenumber(1);
      ratios += (i > 1 ? ", " : "") + std::to_string(0.01 * ratio * ratio);
    }
    const std::string line = "damping = 0.17";
    text.replace(text.find(line), line.size(), "damping_ratio = [" + ratios + "]");
    return write_text(path("beam.toml"), text);
  }

  void simulate(const std::string& scene, const std::string& duration) {
    const Ended ended =
        run(MASTER_SIM, {scene, "--duration", duration, "--speed", "max", "--no-lcm", "--tick",
                         "0.05", "--events", path("events.csv"), "--states", path("master.csv")});
    ASSERT_EQ(ended.code, 0) << ended.err;
  }

  /// Largest difference of the tip of an observer's replica from the master's, from t = 60 on.
  double tip_error(const std::string& scene_file) {
    const Ended ended = run(OBSERVER, {scene_file, "--replay", path("events.csv"), "--tick", "0.05",
                                       "--estimator", "replica", "--states", path("replica.csv")});
    EXPECT_EQ(ended.code, 0) << ended.err;
    const Scene whole = read_scene(path("beam.toml"));
    const Eigen::VectorXd tip = mode_shapes(*whole.beam, whole.beam->length);
    const Scene scene = read_scene(scene_file);
    const Eigen::VectorXd reduced_tip =
        scene.beam ? mode_shapes(*scene.beam, scene.beam->length) : tip_of(scene_file);
    StatesReader master(path("master.csv"));
    StatesReader replica(path("replica.csv"));
    StateRow of_master, of_replica;
    double largest = 0.0;
    int rows = 0;
    while (master.next(of_master) && replica.next(of_replica)) {
      EXPECT_EQ(of_master.k, of_replica.k);
      if (of_master.t < 60.0) continue;
      largest = std::max(largest, std::abs(tip.dot(of_master.q) - reduced_tip.dot(of_replica.q)));
      ++rows;
    }
    EXPECT_GT(rows, 300);
    return largest;
  }

  /// From the comment "# tip: +a q_1 -b q_2 ...".
  static Eigen::VectorXd tip_of(const std::string& scene_file) {
    std::istringstream text(read_text(scene_file));
    std::string word;
    while (text >> word && word != "tip:") {
    }
    std::vector<double> row;
    double value = 0.0;
    while (text >> value >> word) row.push_back(value);
    return Eigen::Map<Eigen::VectorXd>(row.data(), static_cast<Eigen::Index>(row.size()));
  }
};

TEST_F(ReduceProgramTest, ReducesByRecordingAndObserverConverges) {
  const std::string beam = scene();
  simulate(beam, "80");
  const Ended ended = reduce({path("events.csv"), beam, "--modes", "3", "--output",
                              path("reduced.toml"), "--report", path("report.json")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.err, "");
  EXPECT_TRUE(ended.out.starts_with("stiff_beam: 3 modes with b_0, b_1, b_2, b_3")) << ended.out;
  const auto report = test::parse_json(read_text(path("report.json")));
  EXPECT_EQ(report["coordinates"], 7);
  EXPECT_EQ(report["candidates"].back()["correction"], "none");

  // The file matches the library's result.
  const Scene whole = read_scene(beam);
  const auto recorded =
      read_recorded_events(path("events.csv"), 1, 80.0, AfterLoss::dropped, std::nullopt);
  const ModalMachine machine = modal_machine(whole);
  const auto best = reductions(machine, {0, 1, 2}, second_half(recorded.events)).front();
  EXPECT_EQ(to_toml(read_scene(path("reduced.toml"))), to_toml(reduced_scene(whole, best.machine)));
  EXPECT_EQ(report["rms_gap"].get<double>(), best.rms);

  write_scene(path("plain.toml"), reduced_scene(whole, reduced(machine, {0, 1, 2})),
              description(whole, candidates(machine, {0, 1, 2}).front()));
  const double plain = tip_error(path("plain.toml"));
  const double corrected = tip_error(path("reduced.toml"));
  EXPECT_LT(corrected, 1e-2 * plain) << corrected << ' ' << plain;

  // The other programs read the file.
  EXPECT_EQ(run(CHECK_SCENE, {path("reduced.toml")}).code, 0);
  EXPECT_EQ(run(MASTER_SIM, {path("reduced.toml"), "--duration", "2", "--speed", "max", "--no-lcm",
                             "--events", path("own.csv")})
                .code,
            0);

  // The same from a log, and in JSON.
  write_contact_log(path("events.lcmlog"), recorded.events, 1, 80.0, std::nullopt);
  EXPECT_EQ(reduce({path("events.lcmlog"), beam, "--modes", "3"}).out, ended.out);
  const Ended json = reduce({path("events.csv"), beam, "--modes", "3", "--json"});
  EXPECT_EQ(test::parse_json(json.out)["candidates"], report["candidates"]);
}

TEST_F(ReduceProgramTest, WritesTheFewestCoordinatesWithoutEvents) {
  const std::string beam = scene();
  const Ended ended = reduce({beam, "--accuracy", "1e-4", "--output", path("reduced.toml"),
                              "--report", path("report.json")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_TRUE(ended.out.starts_with("stiff_beam: of 20 modes the first ")) << ended.out;
  EXPECT_NE(ended.out.find("(b_0, b_1) are enough as well"), std::string::npos) << ended.out;
  const auto accuracy = test::parse_json(read_text(path("report.json")));
  EXPECT_EQ(accuracy["corrected"]["coordinates"],
            read_scene(path("reduced.toml")).model.coordinates());
  EXPECT_LT(accuracy["corrected"]["coordinates"], accuracy["modes"]);
  EXPECT_LT(accuracy["corrected"]["change"], 1e-4);
  EXPECT_EQ(accuracy["changes"].back()["modes"], 20);
  simulate(beam, "80");
  EXPECT_LT(tip_error(path("reduced.toml")), 1e-4);
}

TEST_F(ReduceProgramTest, AnAccuracyChoosesTheModesAndEventsTheCorrection) {
  const std::string beam = scene(), events = path("events.csv");
  simulate(beam, "40");
  const Ended both = reduce({events, beam, "--accuracy", "1e-2", "--report", path("report.json")});
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_NE(both.out.find("Of these modes with the recorded events:"), std::string::npos);
  const auto of_both = test::parse_json(read_text(path("report.json")));
  const auto by_accuracy = test::parse_json(reduce({beam, "--accuracy", "1e-2", "--json"}).out);
  EXPECT_EQ(of_both["by_accuracy"]["corrected"], by_accuracy["corrected"]);
  const int modes = by_accuracy["corrected"]["modes"];
  const Ended of_events = reduce({events, beam, "--modes", std::to_string(modes), "--json"});
  const auto expected = test::parse_json(of_events.out);
  for (const auto& [key, value] : expected.items()) EXPECT_EQ(of_both[key], value) << key;
}

TEST_F(ReduceProgramTest, NamesWhatIsLeftOutOfThePrior) {
  const std::string beam = write_text(path("prior.toml"), read_text(scene()) + R"(
[parameters]
impact.restitution = { sigma = 0.01, consider = true }
beam.bending_stiffness = { sigma = 0.02 }
[tolerance]
time = 1e-4
)");
  simulate(beam, "20");
  const std::string out = path("reduced.toml");
  const Ended ended = reduce({path("events.csv"), beam, "--modes", "3", "--output", out});
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.err.find("beam.bending_stiffness of [parameters] is left out"),
            std::string::npos);
  EXPECT_NE(ended.err.find("[tolerance] is copied"), std::string::npos) << ended.err;
  EXPECT_EQ(std::ranges::count(ended.err, '\n'), 2) << ended.err;
  EXPECT_EQ(read_scene(out).prior.parameters.keys, std::vector<std::string>{"impact.restitution"});
  EXPECT_EQ(read_scene(out).prior.tolerance.time, 1e-4);
}

TEST_F(ReduceProgramTest, BadUsageAndInputExitWithTwoAndWriteNothing) {
  const std::string beam = scene();
  simulate(beam, "20");
  const std::string events = path("events.csv");
  const std::string out = path("out.toml");
  const std::string coupled = SPRAG_SOURCE_DIR "/scenes/non_proportional.toml";
  for (const auto& [arguments, message] : std::vector<std::pair<Arguments, std::string>>{
           {{}, "SCENE is required"},
           {{beam}, "--modes is required, or --accuracy"},
           {{events, beam}, "--modes is required"},
           {{beam, "--modes", "2"}, "EVENTS is required with --modes"},
           {{beam, "--accuracy", "1e-3", "--modes", "2"}, "--modes excludes --accuracy"},
           {{beam, "--accuracy", "0"}, "--accuracy"},
           {{coupled, "--accuracy", "1e-3"}, "damping couples the modes"},
           {{events, beam, "--modes", "0"},
            "--modes: 0 is not allowed; must be a whole number > 0"},
           {{events, beam, "--modes", "1.5"}, "--modes: 1.5"},
           {{events, beam, "--modes", "21"}, "--modes is 21; the scene has 20"},
           {{path("absent.csv"), beam, "--modes", "2"}, "absent.csv"},
           {{events, path("absent.toml"), "--modes", "2"}, "absent.toml"},
           {{events, coupled, "--modes", "2"}, "damping couples the modes"},
           {{events, beam, "--modes", "2", "--duration", "0"}, "--duration"}}) {
    const Ended ended = reduce(arguments + Arguments{"--output", out});
    EXPECT_EQ(ended.code, 2) << message;
    EXPECT_NE(ended.err.find(message), std::string::npos) << ended.err;
    EXPECT_EQ(ended.out, "");
  }
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(ReduceProgramTest, TooFewEventsDamageAndAFullDiskFail) {
  const std::string beam = scene();
  simulate(beam, "40");
  const std::string events = path("events.csv");
  const Ended few = reduce({events, beam, "--modes", "2", "--duration", "0.4"});
  EXPECT_EQ(few.code, 1);
  EXPECT_NE(few.err.find("at least 8 are needed"), std::string::npos) << few.err;
  const std::string bad = path("absent/out.toml");
  const Ended ended = reduce({events, beam, "--modes", "2", "--output", bad});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find(bad), std::string::npos) << ended.err;
  // The readable part of a damaged file is used.
  const std::string damaged = write_text(path("damaged.csv"), read_text(events) + "41.5,1");
  const Ended part = reduce({damaged, beam, "--modes", "2", "--output", path("part.toml")});
  EXPECT_EQ(part.code, 1);
  EXPECT_NE(part.err.find("everything before is used"), std::string::npos) << part.err;
  EXPECT_EQ(part.out, reduce({events, beam, "--modes", "2"}).out);
  EXPECT_TRUE(std::filesystem::exists(path("part.toml")));
}

}  // namespace
}  // namespace sprag
