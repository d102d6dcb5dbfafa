// Recorded inputs in scenes: reading, interpolation, and the messages for every kind of bad file.
#include "sprag/sampled_input.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"
#include "tests/support/random.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

constexpr std::string_view recorded_beam = R"(name = "x"
[beam]
modes = 3
length = 1.0
bending_stiffness = 1.0
mass_per_length = 1.0
damping = 0.17
[excitation]
file = "base.csv"
[impact]
restitution = 0.7
[[contact]]
position = 0.868
clearance = 0.01
mount = "frame"
)";

constexpr std::string_view good_record =
    "t,a\n0,0\n0.1,1\n0.2,1.5\n0.3,1\n0.4,0\n0.5,-1\n0.6,-1.5\n";

class RecordedInput : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return (directory_ / name).string(); }

  Scene scene_of(std::string_view record, const std::string& keys = "",
                 std::string text = std::string(recorded_beam)) {
    test::write_text(path("base.csv"), record);
    const std::string line = "file = \"base.csv\"\n";
    text.replace(text.find(line), line.size(), line + keys);
    test::write_text(path("x.toml"), text);
    return read_scene(path("x.toml"));
  }

  std::string error_of(std::string_view record, const std::string& keys = "",
                       const std::string& text = std::string(recorded_beam)) {
    return message_of([&] { scene_of(record, keys, text); }, path(""));
  }

  void expect_error(std::string_view record, const std::string& begin,
                    const std::string& keys = "") {
    const std::string message = error_of(record, keys);
    EXPECT_TRUE(message.starts_with(begin)) << message << "\nexpected: " << begin;
  }

  test::TemporaryDirectory directory_;
};

TEST_F(RecordedInput, ForceAndGroundSupportFollowTheRecord) {
  const Scene scene = scene_of(good_record, "unit = 2.0\n");
  ASSERT_TRUE(has_sampled_inputs(scene.model));
  const Force& force = scene.model.forces.at(0);
  EXPECT_EQ(force.direction, inertia_direction(*scene.beam));
  EXPECT_DOUBLE_EQ(force.input->value(0.15), 2.5);
  EXPECT_DOUBLE_EQ(force.input->value(0.1), 2.0);
  EXPECT_EQ(end_of_inputs(scene.model), 0.6);
  EXPECT_EQ(scene.model.contacts[0].input, nullptr);

  std::string text(recorded_beam);
  text.replace(text.find("\"frame\""), 7, "\"ground\"\nside = \"above\"");
  const Scene ground = scene_of(good_record, "", text);
  const Contact& contact = ground.model.contacts[0];
  EXPECT_EQ(contact.input, ground.model.forces[0].input);
  EXPECT_EQ(contact.input_share, -1.0);
  // a = 10 t on the first interval: e = 10 t^3 / 6.
  EXPECT_NEAR(support_motion(contact, 0.1), -1e-3 / 0.6, 1e-16);
  ASSERT_EQ(ground.remarks.size(), 2U);
  EXPECT_NE(ground.remarks[0].find("is not resolved by its sampling"), std::string::npos);
  EXPECT_NE(ground.remarks[1].find("drift"), std::string::npos) << ground.remarks[1];
}

// A stated uncertainty above the interpolation error accounts for it.
TEST_F(RecordedInput, AnUnresolvedRecordIsReportedUnlessItsUncertaintyCoversIt) {
  const auto remark = [&](const std::string& keys) {
    const Scene scene = scene_of(good_record, keys);
    for (const std::string& text : scene.remarks) {
      if (text.find("is not resolved by its sampling") != std::string::npos) return text;
    }
    return std::string();
  };
  EXPECT_TRUE(remark("").ends_with("or set uncertainty")) << remark("");
  EXPECT_TRUE(remark("uncertainty = 1e-6\n").ends_with("or raise uncertainty"));
  EXPECT_EQ(remark("uncertainty = 10.0\n"), "");
}

TEST_F(RecordedInput, ColumnsAreFoundByName) {
  const std::string_view record =
      "# a logger\nT [s];x;\"ay [m/s2]\"\n0;9;0\n1;9;1\n2;9;4\n3;9;9\n4;9;16\n";
  const Scene scene = scene_of(
      record, "time = \"T [s]\"\nacceleration = \"ay [m/s2]\"\ninterpolation = \"spline\"\n");
  EXPECT_NEAR(scene.model.forces[0].input->value(2.5), 6.25, 1e-14);
}

TEST_F(RecordedInput, BlanksAndDecimalCommasAreRead) {
  const Scene plain = scene_of("t,a\n0,0.5\n0.1,-1\n0.2,2e-1\n0.3,1.5\n");
  for (const char* same :
       {"t a\n0 0.5\n0.1 -1\n0.2 2e-1\n0.3 1.5\n", "  0.0    0.5 \n  0.1   -1.0\n 0.2 0.2\n0.3 1.5",
        "0, 0.5\n0.1, -1\n0.2, 0.2\n0.3, 1.5\n", "t\ta\n0\t0,5\n0,1\t-1\n0,2\t2e-1\n0,3\t1,5\n",
        "t;a\n0;0,5\n0,1;-1,0\n0,2;0,2\n0,3;1,5\n", "0,0 0,5\n0,1 -1,0\n0,2 0,2\n0,3 1,5\n"}) {
    const Scene scene = scene_of(same);
    const SampledInput& input = *scene.model.forces[0].input;
    EXPECT_EQ(input.sample_times(), plain.model.forces[0].input->sample_times()) << same;
    EXPECT_EQ(input.sample_values(), plain.model.forces[0].input->sample_values()) << same;
    const bool has_commas = std::string_view(same).find("0,5") != std::string_view::npos;
    const bool is_said = std::ranges::any_of(scene.remarks, [](const std::string& remark) {
      return remark == "excitation.file is read with decimal commas";
    });
    EXPECT_EQ(is_said, has_commas) << same;
  }
}

TEST_F(RecordedInput, HeadsOfRecordersAreRead) {
  const Scene plain = scene_of("t,a\n0,0.5\n0.1,-1\n0.2,0.25\n0.3,1.5\n");
  const std::vector<std::pair<std::string, std::string>> heads{
      {"A recorder; Serial 4711\nRate: 10 Hz\n\nt;a\n", "from line 4 on"},
      {"t;a\ns;m/s\u00B2\n", ""},
      {"Channel;1\nt;a\n(s);(V)\n", "from line 2 on"},
      {"t;a\n[ms];[-]\n", "has times in ms, as column 't' says"},
      {"Rate;10\nGain;2\nTime [ms];a\n", "has times in ms, as column 'Time [ms]' says"}};
  for (const auto& [head, remark] : heads) {
    const bool in_ms = head.find("ms]") != std::string::npos;
    const Scene scene = scene_of(head + (in_ms ? "0;0.5\n100;-1\n200;0.25\n300;1.5\n"
                                               : "0;0.5\n0.1;-1\n0.2;0.25\n0.3;1.5\n"));
    const SampledInput& input = *scene.model.forces[0].input;
    EXPECT_EQ(input.sample_times(), plain.model.forces[0].input->sample_times()) << head;
    EXPECT_EQ(input.sample_values(), plain.model.forces[0].input->sample_values()) << head;
    EXPECT_TRUE(std::ranges::any_of(scene.remarks, [&](const std::string& said) {
      return said.find(remark) != std::string::npos;
    })) << head;
  }
  for (const std::string name :
       {"Time [ms]", "t (MS)", "t / ms", "t_ms", "t in ms", "ms [ms]", "milliseconds"}) {
    EXPECT_EQ(end_of_inputs(scene_of(name + ",a\n0,0\n1,1\n2,1\n3,0\n").model), 0.003) << name;
  }
  for (const std::string name : {"Time [s]", "t_s", "ms", "h", "time", "in", "t (a"}) {
    EXPECT_EQ(end_of_inputs(scene_of(name + ",a\n0,0\n1,1\n2,1\n3,0\n").model), 3.0) << name;
  }
  expect_error("t,a\ns,g\n0,1\n0.1,2\n0.2,3\n0.3,4\n",
               "x.toml:9:8: excitation.file has the column 'a [g]', an acceleration in g");
}

TEST_F(RecordedInput, BadFilesAreRefusedWithPlaceReasonAndRemedy) {
  expect_error("t,a\n0,0\n0.1,1\n0.05,1\n0.3,1\n",
               "base.csv:4:1: the time 0.05 is before that of the row before, 0.1; times must "
               "increase (excitation.file)");
  expect_error("t,a\n0,0\n0.1,1\n0.1,1\n0.3,1\n",
               "base.csv:4:1: the time 0.1 repeats that of the row before");
  expect_error("t,a\n0,0\n0.1,nan\n0.2,1\n0.3,1\n",
               "base.csv:3:5: 'nan' is not a finite number; must be one");
  expect_error("t,a\n0,0\n0.1,\n0.2,1\n0.3,1\n",
               "base.csv:3:5: a field is empty; must be a number");
  expect_error("t,a\n0,0\n0.1,1,2\n0.2,1\n0.3,1\n",
               "base.csv:3:1: the row has 3 fields; must have 2");
  expect_error("t,a\n0,0\n0.1,1\n0.2,1\n", "base.csv: has 3 samples; must have at least 4");
  expect_error("", "base.csv: has no samples");
  // What people's files have, and import_events reads.
  for (const char* other : {"t;a\n0,0;1\n0.1;2\n0,2;3\n0,3;4\n", "t;a\n0;1,000.5\n1;1\n2;1\n3;1\n",
                            "A recorder of a machine\n0 1\n0.1 2\n0.2 3\n0.3 4\n",
                            "t,a\n12:00:00,1\n12:00:01,2\n12:00:02,3\n12:00:03,4\n",
                            "\x93NUMPY\x01", "MATLAB 5.0 MAT-file"}) {
    EXPECT_NE(error_of(other).find("base.csv --record NAME --output RECORD.csv converts"),
              std::string::npos)
        << error_of(other);
  }
  expect_error("t,a,b\n0,0,0\n", "base.csv:1:1: has 3 columns; the scene must name the signal's");
  expect_error(good_record,
               "base.csv:1:1: has no column 'ax' (key of the signal); must be one of 't', 'a'",
               "acceleration = \"ax\"\n");
  expect_error("\x93NUMPY\x01", "base.csv: is a numpy array; sprag import_events");
  expect_error("TDSm\x02", "base.csv: is a binary file; must be a text");
  for (const std::string name : {"Time [ticks]", "t (MIN)", "t / h", "t_samples", "t in days"}) {
    expect_error(name + ",a\n0,0\n1,1\n2,1\n3,0\n",
                 "base.csv:1:1: the column '" + name + "' has times in ");
  }
  expect_error("t,a\nmin,V\n0,0\n1,1\n2,1\n3,0\n",
               "base.csv:1:1: the column 't' has times in min; must be in s, ms, us or ns; sprag");
  // No row is lost above the first two that are alike.
  expect_error("A recorder\nt;a\n0;1;2\n1;x\n2;1\n3;0\n4;1\n5;1\n",
               "base.csv:3:1: the row has 3 fields; must have 2, as the header");
  expect_error("t;a\n0;x\n1;1\n2;1\n3;0\n4;1\n", "base.csv:2:3: 'x' is not a finite number");
  std::string gap = "t,a\n";
  for (int k = 0; k < 40; ++k) {
    if (k < 20 || k > 23) gap += std::to_string(k) + "e-2,0\n";
  }
  expect_error(gap, "base.csv:22:1: there is a gap of 0.05 s after t = 0.19");
  EXPECT_EQ(error_of(gap).find("converts"), std::string::npos);
}

TEST_F(RecordedInput, BadKeysAreRefusedWithPlaceReasonAndRemedy) {
  const std::string at_file = "x.toml:9:8: ";
  expect_error("t,ax [g]\n0,0\n0.1,1\n0.2,1\n0.3,0\n",
               at_file +
                   "excitation.file has the column 'ax [g]', an acceleration in g; the table "
                   "must have unit = 9.80665");
  EXPECT_EQ(error_of("t,ax [g]\n0,0\n0.1,1\n0.2,1\n0.3,0\n", "unit = 9.80665\n"), "no error");
  expect_error("t,a\n1,0\n1.1,1\n1.2,1\n1.3,0\n",
               at_file + "excitation.file begins at t = 1; must begin at t <= 0");
  EXPECT_EQ(error_of("t,a\n1,0\n1.1,1\n1.2,1\n1.3,0\n", "outside = \"zero\"\n"), "no error");
  expect_error(good_record, "x.toml:11:17: excitation.interpolation is \"linear\"; must be",
               "quantity = \"displacement\"\ninterpolation = \"linear\"\n");
  expect_error(good_record, "x.toml:11:11: excitation.outside is \"hold\"; must be \"error\"",
               "quantity = \"displacement\"\noutside = \"hold\"\n");
  expect_error(good_record, "x.toml:11:15: excitation.uncertainty is for an acceleration",
               "quantity = \"displacement\"\nuncertainty = 0.1\n");
  expect_error(good_record, "x.toml:10:8: excitation.unit is 0; must be", "unit = 0.0\n");
  expect_error(good_record, "x.toml:10:8: excitation.gain is 0", "gain = 0.0\n");
  std::string harmonic(recorded_beam);
  harmonic.replace(harmonic.find("file = \"base.csv\""), 17,
                   "amplitude = 1.0\nfrequency = 2.0\ndelay = 0.1");
  EXPECT_NE(sprag::error_of(harmonic).find("excitation.delay is for a recorded input"),
            std::string::npos);
  expect_error(good_record, "x.toml:10:11: excitation.outside is \"stop\"; must be",
               "outside = \"stop\"\n");
  for (const char* more :
       {"[adapt]\nfree = [\"excitation.delay\"]\n",
        "[parameters]\nexcitation.gain = { sigma = 0.1 }\nexcitation.delay = { sigma = 0.1 }\n"}) {
    EXPECT_EQ(error_of(good_record, "", std::string(recorded_beam) + more), "no error");
  }
  std::string ground(recorded_beam);
  ground.replace(ground.find("\"frame\""), 7, "\"ground\"");
  EXPECT_NE(error_of(good_record, "uncertainty = 0.1\n", ground)
                .find("excitation.uncertainty is not supported with supports on the ground"),
            std::string::npos);
}

TEST_F(RecordedInput, GravityInTheRecordIsReported) {
  const Scene scene = scene_of("t,a\n0,1\n0.1,1.001\n0.2,0.999\n0.3,1\n0.4,1\n");
  ASSERT_EQ(scene.remarks.size(), 1U);
  EXPECT_NE(scene.remarks[0].find("if that is gravity in units of g"), std::string::npos);
}

TEST(SampledInput, ReproducesACubicAndItsIntegrals) {
  // e = t^5 / 20 + t^2, e'' = t^3 + 2, at uneven times.
  std::vector<double> t{-0.3, 0.0, 0.2, 0.7, 1.0, 1.1, 1.7};
  std::vector<double> a;
  for (const double s : t) a.push_back(s * s * s + 2.0);
  const SampledInput input(t, a, {.interpolation = Interpolation::spline});
  EXPECT_FALSE(input.even());
  const auto e = [&](double s) { return std::pow(s, 5) / 20.0 + s * s; };
  const auto rate = [&](double s) { return std::pow(s, 4) / 4.0 + 2.0 * s; };
  for (double s = -0.3; s <= 1.7; s += 0.07) {
    EXPECT_NEAR(input.value(s), s * s * s + 2.0, 1e-13) << s;
    EXPECT_NEAR(input.velocity(s), rate(s) - rate(-0.3), 1e-13) << s;
    EXPECT_NEAR(input.displacement(s), e(s) - e(-0.3) - rate(-0.3) * (s + 0.3), 1e-13) << s;
  }
}

TEST(SampledInput, FindsTheIntervalOfEveryTime) {
  constexpr std::uint64_t seed = 20261127;
  SCOPED_TRACE(seed);
  Random random(seed);
  for (const bool even : {true, false}) {
    std::vector<double> t, a;
    for (int k = 0; k < 200; ++k) {
      t.push_back(0.1 * k + (even ? 0.0 : random.uniform(-0.04, 0.04)));
      a.push_back(random.uniform(-1.0, 1.0));
    }
    const SampledInput input(t, a, {});
    EXPECT_EQ(input.even(), even);
    for (int i = 0; i < 1000; ++i) {
      const double s = random.uniform(t.front(), t.back());
      const std::size_t k = input.interval(s);
      EXPECT_LE(input.knots()[k], s);
      EXPECT_GT(input.knots()[k + 1], s);
    }
    for (std::size_t k = 0; k < t.size(); ++k) {
      EXPECT_EQ(input.interval(input.knots()[k]), k);
      EXPECT_NEAR(input.value(input.knots()[k]), a[k], 1e-13);
    }
  }
}

TEST(SampledInput, OutsideIsZeroOrHeld) {
  const std::vector<double> t{1.0, 2.0, 3.0, 4.0}, a{1.0, 2.0, 0.0, 3.0};
  const SampledInput zero(t, a, {.outside = Outside::zero});
  const SampledInput hold(t, a, {.outside = Outside::hold});
  EXPECT_EQ(zero.value(0.5), 0.0);
  EXPECT_EQ(hold.value(0.5), 1.0);
  EXPECT_EQ(zero.value(5.0), 0.0);
  EXPECT_EQ(hold.value(5.0), 3.0);
  EXPECT_DOUBLE_EQ(hold.displacement(1.0), 0.5);
  EXPECT_DOUBLE_EQ(hold.velocity(5.0) - hold.velocity(4.0), 3.0);
  EXPECT_EQ(zero.velocity(5.0), zero.velocity(4.0));
  EXPECT_TRUE(std::isinf(zero.end()));
  EXPECT_EQ(SampledInput(t, a, {}).end(), 4.0);
}

TEST_F(RecordedInput, GainAndDelay) {
  const Scene plain = scene_of(good_record, "unit = 2.0\n");
  const Scene same = scene_of(good_record, "unit = 2.0\ngain = 1.0\ndelay = 0.0\n");
  const Scene other = scene_of(good_record, "unit = 2.0\ngain = -1.5\ndelay = -0.025\n");
  const SampledInput& input = *plain.model.forces.at(0).input;
  const SampledInput& changed = *other.model.forces.at(0).input;
  for (const double t : {0.0, 0.05, 0.31, 0.5}) {
    EXPECT_EQ(same.model.forces.at(0).input->value(t), input.value(t));
    EXPECT_NEAR(changed.value(t), -1.5 * input.value(t + 0.025), 1e-13);
  }
  EXPECT_DOUBLE_EQ(changed.last(), 0.575);
  const SampledInput back = with_gain_and_delay(changed, 1.0, 0.0);
  EXPECT_EQ(back.knots(), input.knots());
  EXPECT_EQ(back.value(0.31), input.value(0.31));
  EXPECT_EQ(
      scene_of(good_record, "gain = -2.0\nuncertainty = 0.1\n").model.forces[0].input->noise(),
      0.2);
}

// A displacement goes on with its first velocity.
TEST(SampledInput, ADelayedDisplacementBeginsWithoutAJump) {
  const std::vector<double> t{0.0, 1.0, 2.0, 3.0}, e{1.0, 2.0, 0.0, 3.0};
  const SampledInput input(
      t, e, {.interpolation = Interpolation::spline, .displacement = true, .delay = 0.5});
  EXPECT_EQ(input.displacement(0.5), 1.0);
  for (const double s : {0.0, 0.2, 0.5}) EXPECT_EQ(input.velocity(s), input.velocity(0.5)) << s;
  EXPECT_DOUBLE_EQ(input.displacement(0.0), 1.0 - 0.5 * input.velocity(0.5));
  EXPECT_EQ(input.value(0.2), 0.0);
}

// A delay is a property of the sensor: before the record begins, its first value is held.
TEST_F(RecordedInput, ADelayMayMakeTheRecordBeginLater) {
  const Scene late = scene_of(good_record, "delay = 0.1\n");
  const Scene held = scene_of(good_record, "delay = 0.1\noutside = \"hold\"\n");
  ASSERT_EQ(late.remarks.size(), 1U + held.remarks.size());
  EXPECT_EQ(late.remarks.front(),
            "excitation.file begins at t = 0.1 with its delay; before, its first value is held");
  const SampledInput& input = *late.model.forces.at(0).input;
  const SampledInput& other = *held.model.forces.at(0).input;
  EXPECT_EQ(input.knots(), other.knots());
  for (const double t : {0.0, 0.04, 0.1, 0.31}) EXPECT_EQ(input.value(t), other.value(t)) << t;
  EXPECT_EQ(input.end(), input.last());
}

TEST_F(RecordedInput, Stream) {
  EXPECT_EQ(scene_of(good_record).stream_duration, 0.0);
  EXPECT_EQ(scene_of(good_record, "stream = true\n").stream_duration, 600.0);
  const Scene scene = scene_of(good_record, "stream = true\nstream_duration = 2.0\ngain = 2.0\n");
  std::shared_ptr<SampledInput> input;
  const Scene streamed = with_stream(scene, input);
  EXPECT_EQ(streamed.model.forces[0].input, input);
  EXPECT_EQ(input->most_samples(), 23U);  // of a sensor that is 1 % fast
  EXPECT_DOUBLE_EQ(input->spacing(), 0.1);
  EXPECT_EQ(input->value(0.3), 0.0);
  EXPECT_TRUE(input->append(0.0, 1.0));
  EXPECT_TRUE(input->append(0.0, 2.0));
  EXPECT_DOUBLE_EQ(input->value(0.05), 3.0);
  EXPECT_DOUBLE_EQ(input->value(0.5), 4.0);

  expect_error(good_record, "x.toml:10:19: excitation.stream_duration is for a streamed input",
               "stream_duration = 2.0\n");
  expect_error("t,a\n0,0\n0.1,1\n0.22,1.5\n0.3,1\n0.4,0\n0.5,-1\n",
               "x.toml:10:10: excitation.stream needs a record with equal intervals",
               "stream = true\n");
  std::string ground(recorded_beam);
  ground.replace(ground.find("mount = \"frame\""), 15, "mount = \"ground\"");
  EXPECT_NE(error_of(good_record, "stream = true\n", ground)
                .find("excitation.stream is for an acceleration, with contacts on the frame"),
            std::string::npos);
}

}  // namespace
}  // namespace sprag
