#include "sprag/detail/parameters/scene_with.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

using test::shipped_scene;

constexpr const char* scenes[] = {"paper_beam",        "paper_beam_frame",  "two_stops_beam",
                                  "two_supports_beam", "lab_rig",           "bouncing_ball",
                                  "non_proportional",  "impact_oscillator", "swept_beam"};

std::vector<Parameter> all_of(const Scene& scene) {
  std::vector<Parameter> all = parameters_of(scene);
  for (const Parameter& unknown : clock_parameters(scene)) all.push_back(unknown);
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
    EXPECT_TRUE(is_near(a.forces[j].direction, b.forces[j].direction)) << what;
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
    for (const Parameter& unknown : all_of(scene)) {
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
    for (const Parameter& unknown : all_of(scene)) {
      if (has_factors && unknown.key.starts_with("excitation.")) continue;
      const double value = unknown.nominal != 0.0 ? 0.97 * unknown.nominal
                                                  : unknown.nominal + 0.1 * unknown.unit_step;
      const Scene changed = with(scene, unknown, value);
      if (unknown.key == "system.K") {
        EXPECT_TRUE(is_near(changed.model.K, value * scene.model.K)) << name;
      } else if (unknown.key == "system.C" || unknown.key == "beam.damping_ratio") {
        EXPECT_TRUE(is_near(changed.model.C, value * scene.model.C)) << name;
      } else {
        EXPECT_NEAR(parameter_of(changed, unknown.key).nominal, value, 1e-14 * std::abs(value))
            << name << ": " << unknown.key;
      }
    }
  }
}

// All keys that a number of a small machine may have.
std::vector<std::string> keys_of_numbers() {
  std::vector<std::string> keys;
  for (const char* of : {"M", "C", "K"}) {
    for (const char* entry : {".1.1", ".1.2", ".2.2"})
      keys.push_back("system." + (of + std::string(entry)));
  }
  for (const char* i : {"1", "2"}) {
    for (const char* of : {"clearance", "restitution", "position", "direction.1", "direction.2",
                           "motion.amplitude", "motion.frequency", "motion.phase"}) {
      keys.push_back(std::string("contact.") + i + '.' + of);
    }
    for (const char* of :
         {"constant", "amplitude", "frequency", "phase", "direction.1", "direction.2"}) {
      keys.push_back(std::string("force.") + i + '.' + of);
    }
    keys.push_back(std::string("beam.damping_ratio.") + i);
    keys.push_back(std::string("excitation.influence.") + i);
  }
  for (const char* of :
       {"beam.length", "beam.mass_per_length", "beam.bending_stiffness", "beam.damping",
        "excitation.amplitude", "excitation.frequency", "excitation.phase", "impact.restitution"}) {
    keys.emplace_back(of);
  }
  return keys;
}

// Compares the machine with another number with that of the file with this number, for each of its
// numbers. Returns how many it has.
std::size_t numbers_equal_the_file(const std::string& given, const std::string& path) {
  const std::string text = without_table(given, "master");  // whose start may be in a support
  const Scene scene = parse_scene(text, path);
  // C follows from M and K.
  const bool by_ratio =
      has_key(text, "system.damping_ratio", path) || has_key(text, "system.rayleigh", path);
  std::size_t count = 0;
  for (const std::string& key : keys_of_numbers()) {
    SCOPED_TRACE(path + ": " + key);
    // A number of several harmonics is in several places of the file.
    const bool is_one = has_key(text, key, path) && (scene_number(scene, key) || scene.beam);
    if (!is_one || (by_ratio && key.starts_with("system."))) continue;
    const Parameter unknown = parameter_of(scene, key);
    // No contact may be beyond the end of a beam.
    const double factor = key.ends_with(".position") ? 0.98 : 1.02;
    const double value = unknown.nominal == 0.0 ? 1e-3 : factor * unknown.nominal;
    std::vector<SceneValue> values{{key, {value}}};
    if (key.ends_with(".1.2")) values.push_back({key.substr(0, key.size() - 3) + "2.1", {value}});
    expect_same_machine(with(scene, unknown, value).model,
                        parse_scene(with_values(text, values, path), path).model, key);
    ++count;
  }
  return count;
}

constexpr const char* two_tones = R"(
[system]
M = [[1.0]]
C = [[0.3]]
K = [[40.0]]
[[force]]
direction = [1.0]
constant = -3.0
amplitude = 2.0
frequency = 9.0
phase = 0.3
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
motion = { amplitude = 0.001, frequency = 4.1 }
[master]
q = [0.01]
)";

// Every number of a machine is that at its path in the file.
TEST(SceneWith, EqualsTheChangedFile) {
  std::size_t count = 0;
  for (const char* name : scenes) {
    const std::string path = std::string(SPRAG_SOURCE_DIR "/scenes/") + name + ".toml";
    std::ifstream file(path);
    count += numbers_equal_the_file({std::istreambuf_iterator<char>(file), {}}, path);
  }
  EXPECT_GE(count, 60U);
  EXPECT_GE(numbers_equal_the_file(two_tones, "two_tones.toml"), 17U);
}

// Setting one frequency to another must not turn two harmonics into one group.
TEST(SceneWith, SeveralParametersAreThoseOfTheGivenScene) {
  const Scene scene = parse_scene(two_tones, "two_tones.toml");
  const std::vector<std::string> keys = {"force.1.frequency", "force.2.amplitude",
                                         "contact.1.restitution", "impact.restitution",
                                         "system.K.1.1"};
  Eigen::VectorXd values(5);
  values << 4.1, 3.0, 0.5, 0.9, 50.0;
  const Model model = with(scene, parameters_named(scene, keys), values).model;
  EXPECT_EQ(model.forces[0].harmonic.frequency, 4.1);
  EXPECT_EQ(model.forces[0].harmonic.amplitude, 2.0);
  EXPECT_EQ(model.forces[1].harmonic.amplitude, 3.0);
  EXPECT_EQ(model.contacts[0].restitution, 0.9 * 0.5);
  EXPECT_EQ(model.contacts[1].restitution, 0.9 * 0.5);
  EXPECT_EQ(model.K(0, 0), 50.0);
}

// A common restitution does not replace one of a single contact, in any order of the keys.
TEST(SceneWith, ASingleNumberIsOnTopOfACommonOne) {
  Scene scene = parse_scene(two_tones, "two_tones.toml");
  for (Contact& contact : scene.model.contacts) contact.restitution = 0.6;
  const Model model =
      with(scene, parameters_named(scene, {"contact.2.restitution", "impact.restitution"}),
           Eigen::Vector2d(0.3, 0.8))
          .model;
  EXPECT_EQ(model.contacts[0].restitution, 0.8);
  EXPECT_EQ(model.contacts[1].restitution, 0.3);
}

TEST(SceneWith, KeysOfNoNumberAreRefused) {
  const Scene scene = parse_scene(two_tones, "two_tones.toml");
  for (const char* key : {"contact.01.clearance", "contact.3.clearance", "contact.1.position",
                          "force.1.gain", "beam.length", "system.M.1.2"}) {
    EXPECT_THROW(parameter_of(scene, key), std::invalid_argument) << key;
  }
}

}  // namespace
}  // namespace sprag
