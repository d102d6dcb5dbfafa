// Invalid scenes and recordings, by mistake or intent, crash no program. An error with exit code 2
// names the position, the fault and the allowed values, and no file is lost.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/support/program_test.h"

namespace sprag::test {
namespace {

std::string shipped(const std::string& name) {
  return SPRAG_SOURCE_DIR "/scenes/" + name + ".toml";
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class HostileInput : public ProgramTest {
 protected:
  std::string file(const std::string& name, const std::string& text) const {
    return write_text(directory_ / name, text);
  }

  /// A mass on a spring of the given stiffness, with a stop.
  std::string scene(const std::string& name, const std::string& K, const std::string& more = "") {
    return file(name, "[system]\nM = [[1.0]]\nC = [[0.1]]\nK = " + K +
                          "\n[[contact]]\ndirection = [1.0]\n" + more +
                          "[impact]\nrestitution = 0.5\n[master]\nq = [1.0]\n");
  }

  void expect_refused(const Ended& ended, const std::string& message) {
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_TRUE(says(ended.err, message)) << ended.err;
    EXPECT_EQ(ended.out, "");
  }
};

TEST_F(HostileInput, EndlessMatrixFileIsRefused) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  for (const std::string matrix : {"/dev/zero", "pipe", "/dev/stdin", "/dev"}) {
    const std::string text = scene("matrix.toml", "\"" + matrix + "\"");
    const Ended ended = run(CHECK_SCENE, {text});
    EXPECT_EQ(ended.code, 2) << matrix << '\n' << ended.err;
    EXPECT_TRUE(says(ended.err, text + ":4:5: system.K names a file: ")) << ended.err;
    EXPECT_TRUE(says(ended.err, "is not a regular file")) << ended.err;
  }
  expect_refused(run(CHECK_SCENE, {"/dev/zero"}), "/dev/zero: is larger than 64 MiB");
}

TEST_F(HostileInput, UnsupportedPropertiesAreRefusedWithReason) {
  const struct {
    const char *K, *more, *message;
  } cases[] = {
      {"[[4.0]]", "friction = 0.3\n",
       ":7:1: contact[1].friction is not supported: contacts are frictionless"},
      {"[[4.0]]", "mu = 0.3\n", ":7:1: contact[1].mu is not supported: contacts are frictionless"},
      {"[[4.0]]", "mu_k = 0.3\n", "mu_k is not supported: contacts are frictionless"},
      {"[[4.0]]", "coulomb = 0.3\n", "coulomb is not supported: contacts are frictionless"},
      {"[[4.0]]", "tangential_restitution = 0.3\n", "is not supported: contacts are frictionless"},
      {"[[4.0]]", "stiffness = 1e6\n", "contact[1].stiffness is not supported: contacts are rigid"},
      {"[[4.0]]\ncubic_stiffness = 3.0", "",
       "system.cubic_stiffness is not supported: the machine is linear"},
      {"[[4.0]]", "clearence = 0.3\n", "did you mean clearance?"},
      {"[[-3.0]]", "",
       ":4:5: system.K has the eigenvalue -3; must be positive semidefinite "
       "(negative stiffness, as of an inverted pendulum or a buckled beam, is not "
       "supported"}};
  for (const auto& [K, more, message] : cases)
    expect_refused(run(CHECK_SCENE, {scene("scene.toml", K, more)}), message);
}

// Recordings.
class HostileEvents : public HostileInput {
 protected:
  /// Forty impacts of the paper's beam.
  const std::string& rows() {
    if (rows_.empty()) {
      const Ended ended = run(MASTER_SIM, {shipped("paper_beam"), "--duration", "25", "--speed",
                                           "max", "--no-lcm", "--events", path("events.csv")});
      EXPECT_EQ(ended.code, 0) << ended.err;
      rows_ = read_text(directory_ / "events.csv");
    }
    return rows_;
  }

  /// Every program that reads events gives the same error.
  void expect_all_refuse(const std::string& events, const std::string& message) {
    const std::string kept = file("states.csv", "kept\n");
    expect_refused(run(OBSERVER, {shipped("paper_beam"), "--replay", events, "--states", kept}),
                   message);
    EXPECT_EQ(read_text(kept), "kept\n");
    expect_refused(run(IDENTIFY, {events, shipped("paper_beam"), "--free", "impact.restitution"}),
                   message);
    expect_refused(run(DIAGNOSE, {events, shipped("paper_beam")}), message);
    expect_refused(run(REDUCE, {events, shipped("paper_beam"), "--modes", "2"}), message);
  }

 private:
  std::string rows_;
};

TEST_F(HostileEvents, ALateRowIsRefusedUnlessTheDurationIsGiven) {
  const auto lines = static_cast<std::size_t>(std::count(rows().begin(), rows().end(), '\n'));
  for (const std::string t : {"1e6", "1e9", "1e300", "1.7e308"}) {
    const std::string events = file("late.csv", rows() + t + ",1,1\n" + t + ",1,0\n");
    expect_all_refuse(events, events + ":" + std::to_string(lines + 1) + ": t is ");
    const Ended until = run(OBSERVER, {shipped("paper_beam"), "--replay", events, "--duration",
                                       "25", "--states", path("until.csv"), "--tick", "0.1"});
    EXPECT_EQ(until.code, 0) << until.err;
  }
  const std::string single = file("single.csv", "t,contact,closed\n1e7,1,1\n1e7,1,0\n");
  expect_refused(run(OBSERVER, {shipped("paper_beam"), "--replay", single}),
                 single + ": the last event is at t = 1e+07, beyond 100000000 ticks of 0.001");
  // A time of another clock.
  std::string epoch = "t,contact,closed\n";
  for (int i = 0; i < 20; ++i) {
    const std::string t = std::to_string(1732190400 + i);
    epoch += t + ",1,1\n" + t + ",1,0\n";
  }
  expect_all_refuse(file("epoch.csv", epoch), ":2: the first event is at t = 1.7321904e+09");
}

// A run that cannot continue keeps its output so far.
TEST_F(HostileInput, SqueezedMachineEndsWithCompleteFiles) {
  const std::string squeezed = file("squeezed.toml", R"([system]
M = [[1.0]]
C = [[0.1]]
K = [[4.0]]
[impact]
restitution = 0.8
[[contact]]
direction = [1.0]
clearance = 0.1
[[contact]]
direction = [-1.0]
clearance = 0.1
motion = { amplitude = 0.3, frequency = 1.0, phase = 0.0 }
[master]
u = [0.5]
)");
  const Ended ended =
      run(MASTER_SIM, {squeezed, "--duration", "30", "--speed", "max", "--no-lcm", "--events",
                       path("events.csv"), "--states", path("states.csv"), "--tick", "0.01"});
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_TRUE(says(ended.err, "t = 2.300")) << ended.err;
  EXPECT_TRUE(says(ended.err, "contacts 1 and 2")) << ended.err;
  EXPECT_TRUE(says(ended.err, "squeeze")) << ended.err;
  const std::string events = read_text(directory_ / "events.csv");
  EXPECT_GT(std::count(events.begin(), events.end(), '\n'), 20);
  EXPECT_TRUE(events.ends_with('\n'));
  EXPECT_GT(read_text(directory_ / "states.csv").size(), 1000U);

  const Ended checked = run(CHECK_SCENE, {squeezed});
  EXPECT_EQ(checked.code, 3) << checked.err;
  EXPECT_TRUE(says(checked.out, "the master's simulation fails: t = 2.300")) << checked.out;
  EXPECT_TRUE(says(checked.out, "no room between them at times")) << checked.out;
}

}  // namespace
}  // namespace sprag::test
