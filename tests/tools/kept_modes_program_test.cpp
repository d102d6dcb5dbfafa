// system.modes with the programs: a cantilever of finite elements bounces on a stop. Its sensor
// merges bounces. The scene that keeps few modes is identified from the merged events and observed.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sprag/detail/files/states_file.h"
#include "sprag/reduction.h"
#include "sprag/scene_file.h"
#include "tests/support/program_test.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::Arguments;
using test::operator+;
using test::read_text;
using test::write_text;

class KeptModesProgramTest : public test::ProgramTest {
 protected:
  /// Writes the matrices of a cantilever of n elements.
  void write_rig(int n) {
    const Ended ended =
        run(SPRAG_SOURCE_DIR "/scripts/cantilever", {path("rig"), std::to_string(n)});
    ASSERT_EQ(ended.code, 0) << ended.err;
  }

  /// Its scene with further keys in [system].
  std::string scene(const std::string& name, const std::string& keys, double restitution) const {
    std::ostringstream text;
    text << "name = \"rig\"\n[system]\nM = \"rig/M.csv\"\nK = \"rig/K.csv\"\ndamping_ratio = 0.02\n"
         << keys << "\n[excitation]\ninfluence = \"rig/shaking.csv\"\namplitude = 0.03\n"
         << "frequency = 9.5\n[[contact]]\ndirection = \"rig/stop.csv\"\n[impact]\nrestitution = "
         << restitution << "\n[[output]]\nname = \"tip\"\ndirection = \"rig/tip.csv\"\n"
         << "[master]\nq = \"rig/start.csv\"\n[replica]\nuncertainty = 0.5\n";
    return write_text(path(name), text.str());
  }

  /// Root mean square of the difference of the tip from the whole machine's, from t = 20 on.
  double tip_error(const std::string& scene_file, const std::string& estimator) {
    const Ended ended =
        run(OBSERVER, {scene_file, "--replay", path("merged.csv"), "--tick", "0.05", "--duration",
                       "60", "--estimator", estimator, "--states", path("observed.csv")});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return difference(scene_file, path("observed.csv"));
  }

  double difference(const std::string& scene_file, const std::string& states) {
    const Scene whole = read_scene(path("whole.toml")), part = read_scene(scene_file);
    StatesReader master(path("master.csv")), of_part(states);
    StateRow a, b;
    double squares = 0.0;
    int rows = 0;
    while (master.next(a) && of_part.next(b)) {
      EXPECT_EQ(a.k, b.k);
      if (a.t < 20.0) continue;
      const double error =
          value(whole.model.outputs[0], a.q, a.u) - value(part.model.outputs[0], b.q, b.u);
      squares += error * error;
      ++rows;
    }
    EXPECT_GT(rows, 500);
    return std::sqrt(squares / rows);
  }

  /// Records the whole machine with a sensor that merges bounces within 50 ms.
  void record(const std::string& whole) {
    const Ended master =
        run(MASTER_SIM, {whole, "--duration", "60", "--speed", "max", "--no-lcm", "--tick", "0.05",
                         "--events", path("events.csv"), "--states", path("master.csv")});
    ASSERT_EQ(master.code, 0) << master.err;
    std::ifstream in(path("events.csv"));
    std::ofstream merged(path("merged.csv"));
    merged << "t,contact,closed\n";
    std::string line;
    double last = -1.0;
    while (std::getline(in, line)) {
      if (!line.ends_with(",1")) continue;
      const std::string t = line.substr(0, line.find(','));
      if (std::stod(t) - last >= 0.05) merged << t << ",1,1\n" << t << ",1,0\n";
      last = std::stod(t);
    }
  }
};

TEST_F(KeptModesProgramTest, MergedBouncesAreIdentifiedAndObserved) {
  write_rig(10);
  const std::string whole = scene("whole.toml", "", 0.7);
  record(whole);
  const Arguments settings = {"--within", "0.2,impact.restitution=3", "--accept"};
  const std::string three = scene("three.toml", "modes = 3", 0.2);
  const Ended fit = run(
      IDENTIFY,
      Arguments{path("merged.csv"), three, "--output", path("fitted.toml"), "--json"} + settings);
  ASSERT_EQ(fit.code, 0) << fit.out << fit.err;
  // The fitted scene keeps the file's coordinates and the key.
  const Scene fitted = read_scene(path("fitted.toml"));
  ASSERT_TRUE(fitted.kept);
  EXPECT_EQ(fitted.kept->given(), 20);
  EXPECT_EQ(fitted.model.coordinates(), 3);
  const auto object = test::parse_json(fit.out);
  for (const auto& parameter : object["parameters"]) {
    if (parameter["parameter"] != "system.K") continue;
    const double K = parameter["value"];
    const Scene nominal = read_scene(three);
    EXPECT_LT((fitted.model.K - K * nominal.model.K).norm(), 1e-9 * nominal.model.K.norm());
    EXPECT_NEAR(K, 1.0, 0.02);
  }
  // The whole machine's model does not follow the merged events; the fitted one does.
  const double of_whole = tip_error(whole, "both");
  const double of_fitted = tip_error(path("fitted.toml"), "both");
  std::printf("rms of the tip's error: whole machine %.3g, 3 modes fitted %.3g\n", of_whole,
              of_fitted);
  EXPECT_LT(of_fitted, 0.3 * of_whole);
}

TEST_F(KeptModesProgramTest, EveryProgramTakesTheScene) {
  write_rig(20);
  const std::string file = scene("part.toml", "modes = 2", 0.6);
  const Ended master =
      run(MASTER_SIM, {file, "--duration", "60", "--speed", "max", "--no-lcm", "--tick", "0.05",
                       "--events", path("merged.csv"), "--states", path("master.csv")});
  ASSERT_EQ(master.code, 0) << master.err;
  EXPECT_NE(read_text(path("master.csv")).find("u2,"), std::string::npos);
  EXPECT_EQ(run(CHECK_SCENE, {file}).code, 0);
  scene("whole.toml", "modes = 2", 0.6);
  EXPECT_LT(tip_error(file, "both"), 1e-8);
  EXPECT_EQ(run(SYNC_LOGGER, {file, "--truth", path("master.csv"), "--estimate",
                              path("observed.csv"), "--csv", path("V.csv")})
                .code,
            0);
  const Ended diagnosis = run(DIAGNOSE, {path("merged.csv"), file});
  EXPECT_EQ(diagnosis.code, 0) << diagnosis.out << diagnosis.err;
  const Ended fit = run(IDENTIFY, {path("merged.csv"), file, "--free", "impact.restitution",
                                   "--output", path("fitted.toml")});
  EXPECT_EQ(fit.code, 0) << fit.out << fit.err;
  EXPECT_NEAR(read_scene(path("fitted.toml")).model.contacts[0].restitution, 0.6, 1e-6);
  EXPECT_EQ(run(REDUCE, {path("merged.csv"), file, "--modes", "2"}).code, 0);
}

TEST_F(KeptModesProgramTest, ReduceNamesTheKeys) {
  write_rig(10);
  const std::string whole = scene("whole.toml", "", 0.7);
  const Ended ended = run(REDUCE, {whole, "--accuracy", "3e-2", "--json"});
  const auto report = test::parse_json(ended.out);
  const std::string what = report["what"];
  const std::size_t at = what.find("the scene keeps these with system.modes = ");
  ASSERT_NE(at, std::string::npos) << what;
  // The keys are accepted, and give as many coordinates.
  std::string keys = what.substr(what.find("system.", at));
  for (std::size_t i; (i = keys.find(", system.")) != std::string::npos;) keys.replace(i, 9, "\n");
  keys.erase(0, std::string("system.").size());
  const std::size_t replica = keys.find(", replica.");
  const std::string of_system = keys.substr(0, replica);
  EXPECT_EQ(read_scene(scene("part.toml", of_system, 0.7)).model.coordinates(),
            report["corrected"]["coordinates"].get<int>())
      << what;
}

}  // namespace
}  // namespace sprag
