// Outputs named in a scene, in the files of master and observer, with their sigma.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sprag/beam.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/observer.h"
#include "sprag/scene_file.h"
#include "sprag/smoother.h"
#include "tests/support/program_test.h"
#include "tests/support/run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

using test::read_text;
using test::shipped_scene;
using test::write_text;

std::string text_of(const std::string& scene) {
  return read_text(SPRAG_SOURCE_DIR "/scenes/" + scene + ".toml");
}

Scene with_outputs(std::string text, const std::string& outputs, double jitter) {
  text = text.substr(0, text.find("[events]"));
  text += "\n" + outputs + "[events]\njitter = " + std::to_string(jitter) + "\n";
  return parse_scene(text, "x.toml");
}

constexpr const char* of_rig = R"([[output]]
name = "second"
direction = [0.0, 1.0]
[[output]]
name = "approach"
direction = [1.0, -1.0]
quantity = "velocity"
)";

TEST(Outputs, SigmaFollowsFromStateCovariance) {
  for (const double jitter : {0.0, 1e-4}) {
    const Scene scene = with_outputs(text_of("lab_rig"), of_rig, jitter);
    const std::vector<ContactEvent> events = test::events_of(scene, 8.0);
    const Estimates all =
        observe(scene, events, 8.0, {.tick = 0.01, .estimator = EstimatorKind::timing});
    TimingEstimator filter(scene, 0.01);
    TrackingState state;
    filter.start(scene.prior.start, 0, 0, state);
    auto next = events.begin();
    for (int k = 1; k <= 800; ++k) {
      const auto since = next;
      while (next != events.end() && next->t <= tick_instant(k, 0.01).hi) ++next;
      filter.tick({since, next}, state);
      if (k % 80 != 0) continue;
      EXPECT_EQ(all.outputs(k, 0), all.q(k, 1));
      EXPECT_EQ(all.outputs(k, 1), all.u(k, 0) - all.u(k, 1));
      const Eigen::MatrixXd P = covariance(filter, state);
      const double of_q = P(1, 1);
      const double of_u = P(2, 2) - 2.0 * P(2, 3) + P(3, 3);
      // Except for the rounding that both add.
      EXPECT_NEAR(all.sigma_outputs(k, 0), std::sqrt(of_q), 1e-9 + 1e-6 * std::sqrt(of_q)) << k;
      EXPECT_NEAR(all.sigma_outputs(k, 1), std::sqrt(of_u), 1e-7 + 1e-6 * std::sqrt(of_u)) << k;
      EXPECT_NEAR(all.sigma_outputs(k, 0), all.sigma_q(k, 1), 1e-12 * all.sigma_q(k, 1)) << k;
    }
    EXPECT_GT(all.sigma_outputs(10, 0), 0.0);
    const Estimates replica =
        observe(scene, events, 1.0, {.tick = 0.01, .estimator = EstimatorKind::replica});
    EXPECT_TRUE(std::isinf(replica.sigma_outputs(5, 1)));
    EXPECT_EQ(replica.outputs(5, 0), replica.q(5, 1));
  }
}

TEST(Outputs, OfABeamAreAtAPosition) {
  const Scene scene = with_outputs(text_of("two_stops_beam"),
                                   "[[output]]\nname = \"middle\"\nposition = 0.5\n", 0.0);
  EXPECT_EQ(scene.model.outputs[0].direction, mode_shapes(*scene.beam, 0.5));
  const Scene again = parse_scene(to_toml(scene), "x.toml");
  EXPECT_EQ(again.model.outputs[0].direction, scene.model.outputs[0].direction);
  EXPECT_EQ(again.model.outputs[0].name, "middle");
}

TEST(Outputs, ErrorsAreReported) {
  const auto error = [](const std::string& output) {
    try {
      with_outputs(text_of("lab_rig"), output, 0.0);
    } catch (const SceneError& refused) {
      return refused.message;
    }
    return std::string("no error");
  };
  const std::string direction = "direction = [1, 0]\n";
  EXPECT_EQ(error("[[output]]\nname = \"a\"\n" + direction), "no error");
  EXPECT_EQ(error("[[output]]\n" + direction), "missing key output[1].name");
  EXPECT_EQ(error("[[output]]\nname = \"tip [m]\"\n" + direction),
            "output[1].name is \"tip [m]\"; must be a letter and letters, digits or _, at most 40");
  EXPECT_EQ(error("[[output]]\nname = \"q2\"\n" + direction),
            "output[1].name is \"q2\", which is a column of states already; must be another");
  for (const char* taken : {"g1", "smoothed"}) {
    EXPECT_EQ(error("[[output]]\nname = \"" + std::string(taken) + "\"\n" + direction),
              "output[1].name is \"" + std::string(taken) +
                  "\", which is a column of states already; must be another");
  }
  EXPECT_EQ(
      error("[[output]]\nname = \"a\"\n" + direction + "[[output]]\nname = \"a\"\n" + direction),
      "output[2].name is \"a\" again; must be another one");
  EXPECT_EQ(error("[[output]]\nname = \"a\"\nposition = 1.0\n"),
            "unknown key output[1].position; must be one of name, direction, quantity, unit");
  EXPECT_EQ(error("[[output]]\nname = \"a\"\ndirection = [1, 0, 0]\n"),
            "output[1].direction has size 3; must be 2, as many as coordinates");
  EXPECT_EQ(error("[[output]]\nname = \"a\"\nquantity = \"force\"\n" + direction),
            "output[1].quantity is \"force\"; must be \"displacement\" or \"velocity\"");
  EXPECT_EQ(
      error("[[output]]\nname = \"a\"\nunit = \"" + std::string(21, 'm') + "\"\n" + direction),
      "output[1].unit has 21 bytes; must have at most 20");
}

TEST(Outputs, UnitsAreReadAndWritten) {
  const Scene scene =
      with_outputs(text_of("lab_rig"), std::string(of_rig) + "unit = \"\\\"µm\\\" / s\"\n", 0.0);
  const Scene again = parse_scene(to_toml(scene, ""), "x.toml");
  for (const Scene& of : {scene, again}) {
    ASSERT_EQ(of.model.outputs.size(), 2U);
    EXPECT_EQ(of.model.outputs[0].unit, "");
    EXPECT_EQ(of.model.outputs[1].unit, "\"µm\" / s");
  }
}

class OutputsProgramTest : public test::ProgramTest {
 protected:
  /// By column.
  std::map<std::string, std::vector<double>> table(const std::string& name) const {
    std::map<std::string, std::vector<double>> table;
    std::istringstream file(read_text(directory_ / name));
    std::string line;
    std::getline(file, line);
    std::vector<std::string_view> fields;
    const std::string header = line;
    split_fields(header, fields);
    const std::vector<std::string> names(fields.begin(), fields.end());
    while (std::getline(file, line)) {
      split_fields(line, fields);
      for (std::size_t i = 0; i < names.size(); ++i) {
        table[names[i]].push_back(std::stod(std::string(fields[i])));
      }
    }
    return table;
  }
};

TEST_F(OutputsProgramTest, AreColumnsOfASmoothedPath) {
  const std::string middle = "\n[[output]]\nname = \"middle\"\nposition = 0.5\n";
  const std::string tip =
      "[[output]]\nname = \"tip_speed\"\nposition = 1.0\nquantity = \"velocity\"\n";
  std::string text = text_of("paper_beam");
  text += middle + tip + "[events]\njitter = 1e-4\n";
  write_text(path("beam.toml"), text);
  const Scene scene = parse_scene(text, "beam.toml");
  Ended ended = run(
      MASTER_SIM, {path("beam.toml"), "--duration", "15", "--speed", "max", "--no-lcm", "--events",
                   path("events.csv"), "--tick", "0.01", "--states", path("master.csv")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  auto master = table("master.csv");
  EXPECT_FALSE(master.contains("sigma_middle"));
  const Eigen::Vector3d u(master["u1"].back(), master["u2"].back(), master["u3"].back());
  EXPECT_EQ(master["tip_speed"].back(), scene.model.outputs[1].direction.dot(u));
  ended = run(OBSERVER,
              {path("beam.toml"), "--replay", path("events.csv"), "--tick", "0.01", "--smooth",
               "--states", path("smoothed.csv"), "--report", path("report.json")});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const std::string written = read_text(path("smoothed.csv"));
  const std::string header = written.substr(0, written.find('\n'));
  EXPECT_TRUE(header.ends_with(",sigma_g1,smoothed,middle,sigma_middle,tip_speed,sigma_tip_speed"))
      << header;
  const auto smoothed = table("smoothed.csv");
  std::vector<SmoothedEstimate> estimates;
  smooth(scene, test::events_of(scene, 15.0), 0.01, std::ssize(smoothed.at("k")) - 1,
         [&](std::int64_t, const SmoothedEstimate& e, bool) { estimates.push_back(e); });
  ASSERT_GT(estimates.size(), 1000U);
  double ticks = 0.0;
  for (std::size_t k = 0; k < estimates.size(); ++k) {
    const SmoothedEstimate& of = estimates[k];
    EXPECT_EQ(smoothed.at("middle")[k], value(scene.model.outputs[0], of.q, of.u));
    EXPECT_EQ(smoothed.at("tip_speed")[k], value(scene.model.outputs[1], of.q, of.u));
    EXPECT_EQ(smoothed.at("sigma_middle")[k], of.sigma_outputs[0]);
    EXPECT_EQ(smoothed.at("sigma_tip_speed")[k], of.sigma_outputs[1]);
    ticks += smoothed.at("smoothed")[k];
  }
  EXPECT_GT(ticks, 0.0);
  EXPECT_EQ(test::parse_json(read_text(path("report.json")))["smoothed_ticks"], ticks);
}

}  // namespace
}  // namespace sprag
