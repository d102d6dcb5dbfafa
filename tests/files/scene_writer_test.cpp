// A scene that is written and parsed again is the same scene, bit for bit.
#include "sprag/detail/files/scene_writer.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <filesystem>

#include "sprag/replica.h"
#include "sprag/scene_file.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using Bits = std::vector<std::uint64_t>;

void add(Bits& bits, double value) { bits.push_back(std::bit_cast<std::uint64_t>(value)); }

void add(Bits& bits, const Eigen::MatrixXd& matrix) {
  bits.push_back(static_cast<std::uint64_t>(matrix.rows()));
  for (const double value : matrix.reshaped()) add(bits, value);
}

void add(Bits& bits, const Harmonic& harmonic) {
  add(bits, harmonic.amplitude);
  add(bits, harmonic.frequency);
  add(bits, harmonic.phase);
}

// The whole content of a scene about its machine, its starts and its events.
Bits bits_of(const Scene& scene) {
  Bits bits;
  const Model& model = scene.model;
  for (const Eigen::MatrixXd& matrix : {model.M, model.C, model.K}) add(bits, matrix);
  for (const Force& force : model.forces) {
    add(bits, force.direction);
    add(bits, force.constant);
    add(bits, force.harmonic);
  }
  for (const Contact& contact : model.contacts) {
    add(bits, contact.w);
    add(bits, contact.clearance);
    add(bits, contact.motion);
    add(bits, contact.restitution);
    add(bits, restitution_of_replica(contact));
    bits.push_back(contact.replica_restitution.has_value() ? 1 : 0);
  }
  bits.push_back(model.law == ImpactLaw::newton ? 1 : 0);
  add(bits, model.chatter_time);
  for (const State& state : {scene.truth.start, scene.prior.start}) {
    add(bits, state.q);
    add(bits, state.u);
  }
  bits.push_back(scene.truth.release_penetration ? 1 : 0);
  add(bits, scene.prior.uncertainty);
  add(bits, scene.prior.drift);
  add(bits, scene.prior.jitter);
  add(bits, scene.clock.offset);
  add(bits, scene.clock.rate);
  const Tolerance& tolerance = scene.prior.tolerance;
  for (const double value : {tolerance.time, tolerance.restitution, tolerance.stiffness,
                             tolerance.damping, tolerance.force, tolerance.clearance}) {
    add(bits, value);
  }
  add(bits, scene.prior.adaptation.within);
  add(bits, scene.prior.adaptation.walk);
  bits.push_back(scene.prior.adaptation.free.size());
  return bits;
}

Scene written_and_read(const Scene& scene) {
  const std::string text = to_toml(scene, "first line\nsecond \"line\"\n\nlast");
  try {
    return parse_scene(text, "written.toml");
  } catch (const SceneError& error) {
    ADD_FAILURE() << error.what() << '\n' << text;
    return scene;
  }
}

TEST(SceneWriter, ShippedScenesRoundTripBitForBit) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(SPRAG_SOURCE_DIR "/scenes")) {
    if (entry.path().extension() != ".toml") continue;
    const Scene scene = read_scene(entry.path());
    if (has_sampled_inputs(scene.model)) {
      EXPECT_THROW(to_toml(scene, ""), SceneError) << entry.path();
      continue;
    }
    const Scene again = written_and_read(scene);
    EXPECT_EQ(bits_of(again), bits_of(scene)) << entry.path();
    EXPECT_EQ(again.name, scene.name);
    EXPECT_FALSE(again.beam);
    ++count;
  }
  EXPECT_GE(count, 14);
}

TEST(SceneWriter, RandomMachinesRoundTripBitForBit) {
  constexpr std::uint64_t seed = 20261122;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (int i = 0; i < repetitions(200); ++i) {
    ImpactingMachine machine = random_impacting_machine(random);
    Scene scene;
    scene.name = "a \"name\"\\ with\ttab";
    scene.model = machine.model;
    scene.truth.start = machine.start;
    scene.prior.start = random_state(random, scene.model);
    scene.prior.start.u[0] = -0.0;
    scene.prior.drift = random.log_uniform(1e-300, 1e300);
    scene.prior.jitter = random.chance(0.5) ? 0.0 : random.log_uniform(1e-9, 1.0);
    if (random.chance(0.5)) {
      scene.clock = {.offset = random.uniform(-1.0, 1.0), .rate = random.log_uniform(1e-3, 1e3)};
    }
    if (random.chance(0.5)) {
      scene.prior.tolerance = {.time = random.log_uniform(1e-9, 1.0),
                               .restitution = random.uniform(0.0, 1.0),
                               .stiffness = random.uniform(0.0, 0.5),
                               .damping = random.uniform(0.0, 0.5),
                               .force = random.log_uniform(1e-9, 1e9),
                               .clearance = random.log_uniform(1e-9, 1.0)};
    }
    scene.truth.release_penetration = random.chance(0.5);
    if (random.chance(0.5)) scene.prior.adaptation.free = {"contact.1.clearance", "system.K.1.1"};
    const auto free = std::max<Eigen::Index>(1, std::ssize(scene.prior.adaptation.free));
    scene.prior.adaptation.within =
        random.vector(free).cwiseAbs() + Eigen::VectorXd::Constant(free, 0.1);
    scene.prior.adaptation.walk = random.vector(free).cwiseAbs();
    if (random.chance(0.5)) {
      scene.prior.uncertainty = random.vector(scene.model.coordinates()).cwiseAbs() +
                                Eigen::VectorXd::Constant(scene.model.coordinates(), 1e-9);
    }
    if (random.chance(0.5)) {
      for (Contact& contact : scene.model.contacts) {
        contact.replica_restitution = random.uniform(-1, 1);
      }
    }
    const Scene again = written_and_read(scene);
    ASSERT_EQ(bits_of(again), bits_of(scene)) << i;
    EXPECT_EQ(again.name, scene.name);
  }
}

// The replica of the parsed scene gives the same states, bit for bit.
TEST(SceneWriter, ReplicaOfWrittenSceneIsTheSame) {
  for (const char* name : {"paper_beam_chatter", "two_stops_beam", "non_proportional"}) {
    Scene scene = test::shipped_scene(name);
    scene.model.contacts[0].replica_restitution = -0.125;
    const Scene again = written_and_read(scene);
    const std::vector<ContactEvent> events = test::events_of(scene, 5.0);
    ASSERT_EQ(test::events_of(again, 5.0), events);
    Bits runs[2];
    for (int i : {0, 1}) {
      const Scene& of = i == 0 ? scene : again;
      Replica replica(of, 0.01);
      Replica::State state;
      replica.start(of.prior.start, 0, 0, state);
      Eigen::VectorXd q(of.model.coordinates()), u(of.model.coordinates());
      auto next = events.begin();
      for (int k = 1; k <= 500; ++k) {
        const auto since = next;
        while (next != events.end() && next->t <= tick_instant(k, 0.01).hi) ++next;
        replica.tick({since, next}, state);
        replica.output(state, q, u);
        add(runs[i], q);
        add(runs[i], u);
      }
    }
    EXPECT_EQ(runs[0], runs[1]) << name;
  }
}

TEST(SceneWriter, AFileThatCannotBeWrittenIsNamed) {
  const test::TemporaryDirectory directory;
  const auto file = directory / "absent/scene.toml";
  try {
    write_scene(file, test::shipped_scene("lab_rig"));
    FAIL() << "written";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(file.string()), std::string::npos) << error.what();
  }
  write_scene(directory / "scene.toml", test::shipped_scene("lab_rig"), "what it is");
  EXPECT_TRUE(test::read_text(directory / "scene.toml").starts_with("# what it is\nname = "));
}

TEST(SceneReader, TheReplicasRestitutionMayBeNegative) {
  Scene scene = test::shipped_scene("two_stops_beam");
  scene.model.contacts[1].replica_restitution = -0.5;
  const std::string text = to_toml(scene);
  const std::string given = text.substr(text.find("[replica]"));
  ASSERT_NE(given.find("restitution = ["), std::string::npos) << given;
  const auto error_of = [&](const std::string& value) {
    const std::size_t begin = text.find("restitution", text.find("[replica]"));
    std::string changed = text;
    changed.replace(begin, text.find('\n', begin) - begin, "restitution = " + value);
    try {
      parse_scene(changed, "x.toml");
    } catch (const SceneError& error) {
      return error.message;
    }
    return std::string("no error");
  };
  EXPECT_EQ(error_of("-1.0"), "no error");
  EXPECT_EQ(error_of("[-1.0, 1]"), "no error");
  EXPECT_EQ(error_of("-1.1"), "replica.restitution has -1.1; must be in [-1, 1]");
  EXPECT_EQ(error_of("[0.5, 2.0]"), "replica.restitution has 2; must be in [-1, 1]");
  EXPECT_EQ(error_of("[0.5, 0.5, 0.5]"), "replica.restitution has 3 numbers; must be one or 2");
}

}  // namespace
}  // namespace sprag
