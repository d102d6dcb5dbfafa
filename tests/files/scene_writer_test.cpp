// A scene that is written and parsed again is the same scene, bit for bit.
#include "sprag/detail/files/scene_writer.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <filesystem>

#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"
#include "tests/support/by_speed.h"
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

void add(Bits& bits, const SampledInputPointer& input) {
  bits.push_back(input ? 1 : 0);
  if (!input) return;
  const SampledInput::Settings& settings = input->settings();
  for (const double t : input->sample_times()) add(bits, t);
  for (const double value : input->sample_values()) add(bits, value);
  for (const double value : {settings.noise, settings.gain, settings.delay}) add(bits, value);
  for (const auto choice : {static_cast<int>(settings.interpolation),
                            static_cast<int>(settings.outside), int{settings.displacement}}) {
    bits.push_back(static_cast<std::uint64_t>(choice));
  }
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
    add(bits, force.input);
  }
  for (const Contact& contact : model.contacts) {
    add(bits, contact.w);
    add(bits, contact.clearance);
    add(bits, contact.motion);
    add(bits, contact.input);
    add(bits, contact.input_share);
    add(bits, contact.restitution);
    add(bits, restitution_of_replica(contact));
    bits.push_back(contact.replica_restitution.has_value() ? 1 : 0);
    add(bits, contact.curve.slope);
    for (const double number : contact.curve.at) add(bits, number);
    for (const double number : contact.curve.value) add(bits, number);
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
  bits.push_back(static_cast<std::uint64_t>(scene.prior.confidence));
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
  add(bits, scene.prior.parameters.sigma);
  add(bits, scene.prior.parameters.correlation);
  for (const double position : scene.positions) add(bits, position);
  add(bits, scene.stream_duration);
  add(bits, scene.stream_unit);
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
    const Scene again = written_and_read(scene);
    EXPECT_EQ(bits_of(again), bits_of(scene)) << entry.path();
    EXPECT_EQ(scene.name, entry.path().stem().string());
    EXPECT_EQ(again.name, scene.name);
    EXPECT_EQ(again.beam.has_value(), scene.beam.has_value());
    ++count;
  }
  EXPECT_GE(count, 15);
}

std::string samples(const std::string& of) {
  return "record = { name = \"rig\", time = [0.0, 0.1, 0.2, 0.3, 0.4], values = [" + of + "] }\n";
}

std::string beam_with(const std::string& excitation, const std::string& contacts) {
  return "[beam]\nmodes = 3\nlength = 1.0\nbending_stiffness = 2.0\nmass_per_length = 3.0\n"
         "damping_ratio = [0.01, 0.02, 0.03]\n" +
         excitation + contacts +
         "[impact]\nrestitution = 0.5\n[[output]]\nname = \"tip\"\nposition = 0.9\n"
         "[parameters]\n\"contact.1.clearance\" = { sigma = 1e-5 }\n"
         "[adapt]\nfree = [\"impact.restitution\"]\n";
}

TEST(SceneWriter, BeamsAndRecordsRoundTripBitForBit) {
  const std::string above = "[[contact]]\nposition = 0.8\nside = \"above\"\nclearance = 0.01\n",
                    frame = "[[contact]]\nposition = 1.0\nmount = \"frame\"\n",
                    harmonic = "[excitation]\namplitude = 0.003\nfrequency = 7.7\nphase = 0.3\n",
                    mass = "[system]\nM = [[1.0]]\nC = [[0.1]]\nK = [[9.0]]\n",
                    contact = "[[contact]]\ndirection = [1.0]\n";
  const std::vector<std::string> texts{
      beam_with("", above + frame),
      beam_with(harmonic, above + frame),
      beam_with(harmonic, frame),
      beam_with("[excitation]\namplitude = 0.0\nfrequency = 3.0\n", above),
      beam_with("[excitation]\n" + samples("0.1, 0.3, -0.2, 1.0, 0.0"), frame),
      beam_with("[excitation]\nquantity = \"displacement\"\n" + samples("0, 0.1, 0.2, 0.1, 0"),
                above + frame),
      beam_with("[excitation]\nstream = true\nunit = 9.8\nuncertainty = 0.1\ngain = 1.1\n"
                "delay = 0.01\noutside = \"hold\"\n" +
                    samples("0.1, 0.3, -0.2, 1.0, 0.0"),
                frame),
      beam_with(harmonic + samples("0.1, 0.3, -0.2, 1.0, 0.0"), above),
      mass + "[[force]]\ndirection = [1.0]\n" + samples("0.1, 0.3, -0.2, 1.0, 0.0") + contact +
          "restitution = 0.5\n",
      mass + "[excitation]\ninfluence = 1.0\n" + samples("0.1, 0.3, -0.2, 1.0, 0.0") + contact +
          "restitution = 0.5\n",
  };
  for (const std::string& text : texts) {
    SCOPED_TRACE(text);
    const Scene scene = parse_scene(text, "given.toml");
    const Scene again = written_and_read(scene);
    EXPECT_EQ(bits_of(again), bits_of(scene));
    EXPECT_EQ(again.beam.has_value(), scene.beam.has_value());
    EXPECT_EQ(again.prior.parameters.keys, scene.prior.parameters.keys);
    EXPECT_EQ(again.prior.adaptation.free, scene.prior.adaptation.free);
  }
}

// Other damping than a beam's keys give.
TEST(SceneWriter, ABeamOfOtherMatricesIsASystem) {
  Scene scene = test::shipped_scene("paper_beam");
  scene.model.C(0, 0) *= 1.5;
  const Scene again = written_and_read(scene);
  EXPECT_FALSE(again.beam);
  EXPECT_EQ(again.model.C, scene.model.C);
}

TEST(SceneReader, SamplesInTheSceneAreChecked) {
  const auto error_with = [](const std::string& record) {
    return error_of(
        "[system]\nM = [[1.0]]\nC = [[0.1]]\nK = [[9.0]]\n[[force]]\n"
        "direction = [1.0]\n" +
        record + "[[contact]]\ndirection = [1.0]\nrestitution = 0.5\n");
  };
  EXPECT_EQ(error_with(samples("1, 2, 3, 4, 5")), "no error");
  EXPECT_NE(error_with(samples("1, 2, 3")).find(": force[1].record"), std::string::npos)
      << error_with(samples("1, 2, 3"));
  EXPECT_NE(error_with("record = { time = [0, 1, 1, 2], values = [1, 2, 3, 4] }\n"), "no error");
  EXPECT_NE(error_with(samples("1, 2, 3, 4, 5") + "file = \"x.csv\"\n"), "no error");
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
    scene.prior.confidence = static_cast<ConfidenceLevel>(i % 3);
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
    if (random.chance(0.5)) test::let_restitutions_fall(random, 2.0, scene.model);
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
  for (const auto& [value, error] :
       {std::pair("-1.0", "no error"),
        {"[-1.0, 1]", "no error"},
        {"-1.1", ": replica.restitution has -1.1; must be in [-1, 1]"},
        {"[0.5, 2.0]", ": replica.restitution has 2; must be in [-1, 1]"},
        {"[0.5, 0.5, 0.5]", ": replica.restitution has 3 numbers; must be one or 2"}}) {
    const std::size_t begin = text.find("restitution", text.find("[replica]"));
    std::string changed = text;
    changed.replace(begin, text.find('\n', begin) - begin, std::string("restitution = ") + value);
    EXPECT_TRUE(error_of(changed).ends_with(error)) << value << ": " << error_of(changed);
  }
}

}  // namespace
}  // namespace sprag
