#include "sprag/detail/parameters/scene_with.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;
using test::shipped_scene;

constexpr const char* scenes[] = {"paper_beam",        "paper_beam_frame",  "two_stops_beam",
                                  "two_supports_beam", "lab_rig",           "bouncing_ball",
                                  "non_proportional",  "impact_oscillator", "swept_beam"};

std::vector<Unknown> all_of(const Scene& scene) {
  std::vector<Unknown> all = unknowns_of(scene);
  for (const Unknown& unknown : clock_unknowns(scene)) all.push_back(unknown);
  return all;
}

bool is_near(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).norm() <= 1e-14 * b.norm();
}

bool is_near(const Harmonic& a, const Harmonic& b) {
  return std::abs(a.amplitude - b.amplitude) <= 1e-14 * std::abs(b.amplitude) &&
         std::abs(a.frequency - b.frequency) <= 1e-14 * b.frequency &&
         std::abs(a.phase - b.phase) <= 1e-14;
}

void expect_same_machine(const Model& a, const Model& b, const std::string& what) {
  EXPECT_TRUE(is_near(a.M, b.M) && is_near(a.C, b.C) && is_near(a.K, b.K)) << what;
  ASSERT_EQ(a.forces.size(), b.forces.size()) << what;
  for (std::size_t j = 0; j < a.forces.size(); ++j) {
    EXPECT_EQ(a.forces[j].constant, b.forces[j].constant) << what;
    EXPECT_TRUE(is_near(a.forces[j].harmonic, b.forces[j].harmonic)) << what;
  }
  ASSERT_EQ(a.contacts.size(), b.contacts.size()) << what;
  for (std::size_t i = 0; i < a.contacts.size(); ++i) {
    EXPECT_EQ(a.contacts[i].restitution, b.contacts[i].restitution) << what;
    EXPECT_EQ(a.contacts[i].clearance, b.contacts[i].clearance) << what;
    EXPECT_TRUE(is_near(a.contacts[i].motion, b.contacts[i].motion)) << what;
    EXPECT_TRUE(is_near(a.contacts[i].w, b.contacts[i].w)) << what;
  }
}

TEST(SceneWith, NominalValuesGiveTheScene) {
  for (const char* name : scenes) {
    const Scene scene = shipped_scene(name);
    for (const Unknown& unknown : all_of(scene)) {
      const Scene same = with(scene, unknown, unknown.nominal);
      expect_same_machine(same.model, scene.model, name + (": " + unknown.key));
      EXPECT_EQ(same.clock, scene.clock) << name << ": " << unknown.key;
    }
  }
}

// Factors read back as 1: those on C and K, and the excitation of a force and a support together.
TEST(SceneWith, TheValueIsReadBack) {
  for (const char* name : scenes) {
    const Scene scene = shipped_scene(name);
    const bool has_factors = name == std::string("non_proportional");
    for (const Unknown& unknown : all_of(scene)) {
      if (has_factors && unknown.key.starts_with("excitation.")) continue;
      const double value = unknown.nominal != 0.0 ? 0.97 * unknown.nominal
                                                  : unknown.nominal + 0.1 * unknown.unit_step;
      const Scene changed = with(scene, unknown, value);
      if (unknown.key == "system.K") {
        EXPECT_TRUE(is_near(changed.model.K, value * scene.model.K)) << name;
      } else if (unknown.key == "system.C" || unknown.key == "beam.damping_ratio") {
        EXPECT_TRUE(is_near(changed.model.C, value * scene.model.C)) << name;
      } else {
        EXPECT_NEAR(unknown_of(changed, unknown.key).nominal, value, 1e-14 * std::abs(value))
            << name << ": " << unknown.key;
      }
    }
  }
}

TEST(SceneWith, EqualsTheChangedFile) {
  std::ifstream file(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const Scene scene = parse_scene(text, "x.toml");
  const struct {
    const char* key;
    double value;
    std::string line, other;
  } cases[] = {
      {"impact.restitution", 0.65, "restitution = 0.7", "restitution = 0.65"},
      {"beam.damping", 0.2, "damping = 0.17", "damping = 0.2"},
      {"beam.bending_stiffness", 1.02, "bending_stiffness = 1.0", "bending_stiffness = 1.02"},
      {"contact.1.clearance", 0.003, "clearance = 0.0", "clearance = 0.003"},
      {"contact.1.position", 0.88, "position = 0.868", "position = 0.88"},
      {"excitation.amplitude", 0.031, "amplitude = 0.03", "amplitude = 0.031"},
      {"excitation.phase", 0.1, "frequency = 9.5", "phase = 0.1\nfrequency = 9.5"},
      {"excitation.frequency", 9.6, "frequency = 9.5", "frequency = 9.6"},
  };
  ASSERT_EQ(unknowns_of(scene).size(), std::size(cases));
  for (const auto& of : cases) {
    std::string changed = text;
    changed.replace(changed.find(of.line), of.line.size(), of.other);
    expect_same_machine(with(scene, unknown_of(scene, of.key), of.value).model,
                        parse_scene(changed, "x.toml").model, of.key);
  }
}

// Setting one frequency to another must not turn two harmonics into one group.
TEST(SceneWith, SeveralParametersAreThoseOfTheGivenScene) {
  const Scene scene = parse_scene(R"(
[system]
M = [[1.0]]
C = [[0.3]]
K = [[40.0]]
[[force]]
direction = [1.0]
amplitude = 2.0
frequency = 9.0
[[force]]
direction = [1.0]
amplitude = 1.5
frequency = 4.1
[impact]
restitution = 0.7
[[contact]]
direction = [1.0]
clearance = 0.01
[[contact]]
direction = [-1.0]
clearance = 0.02
restitution = 0.5
[master]
q = [0.01]
)",
                                  "two.toml");
  const std::vector<std::string> keys = {"force.1.frequency", "force.2.amplitude",
                                         "contact.1.restitution", "impact.restitution",
                                         "system.K.1.1"};
  Eigen::VectorXd values(5);
  values << 4.1, 3.0, 0.5, 0.9, 50.0;
  const Model model = with(scene, unknowns_named(scene, keys), values).model;
  EXPECT_EQ(model.forces[0].harmonic.frequency, 4.1);
  EXPECT_EQ(model.forces[0].harmonic.amplitude, 2.0);
  EXPECT_EQ(model.forces[1].harmonic.amplitude, 3.0);
  EXPECT_EQ(model.contacts[0].restitution, 0.9 * 0.5);
  EXPECT_EQ(model.contacts[1].restitution, 0.9 * 0.5);
  EXPECT_EQ(model.K(0, 0), 50.0);
}

}  // namespace
}  // namespace sprag
