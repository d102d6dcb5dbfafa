// No program's output overwrites one of its inputs or another output.
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class OverwriteTest : public EndToEnd {
 protected:
  void SetUp() override {
    EndToEnd::SetUp();
    beam_ = write_text(file("beam.toml"), read_text(scene("paper_beam")));
    events_ = simulate(beam_, "5", "0.1");
    truth_ = file("truth.csv");
    key_ = write_text(file("key"), std::string(64, 'a').append("\n"));
    rig_ = write_text(file("rig.csv"), "t\n0.5\n1\n");
    before_ = contents();
  }

  std::vector<std::string> contents() const {
    return {read_text(beam_), read_text(events_), read_text(truth_), read_text(key_),
            read_text(rig_)};
  }

  /// Both options name the same file, by two names or by one.
  void expect_refused(const std::string& program, const Arguments& arguments,
                      const std::string& first, const std::string& second) {
    SCOPED_TRACE(program + ' ' + testing::PrintToString(arguments));
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(first), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find(second), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find("same file"), std::string::npos) << ended.err;
    EXPECT_EQ(contents(), before_);
  }

  std::string beam_, events_, truth_, key_, rig_;
  std::vector<std::string> before_;
};

TEST_F(OverwriteTest, NoProgramOverwritesItsInputsOrAnotherOutput) {
  const Arguments master{beam_, "--no-lcm", "--speed", "max", "--duration", "1"};
  const Arguments replay{beam_, "--replay", events_};
  const std::string estimate = write_text(file("estimate.csv"), read_text(truth_));
  const Arguments logger{beam_, "--truth", truth_, "--estimate", estimate};
  const Arguments reduce{events_, beam_, "--modes", "2"};
  const std::string out = file("out.csv"), now = file("out_now.csv");
  struct Case {
    std::string program;
    Arguments arguments;
    std::string first, option, file;  // the option names the file of the first
  };
  std::vector<Case> cases{
      {"master_sim", master + Arguments{"--events", out}, "--events", "--states", out},
      {"master_sim", master + Arguments{"--states", out}, "--states", "--report", out},
      {"observer", replay + Arguments{"--smooth"}, "--replay", "--states", events_},
      {"observer", replay + Arguments{"--predict", "1"}, "--replay", "--predictions", events_},
      {"observer", replay + Arguments{"--states", out}, "--states", "--events", out},
      {"observer", {beam_}, "SCENE", "--states", beam_},
      {"sync_logger", logger, "--truth", "--csv", truth_},
      {"sync_logger", logger, "--estimate", "--csv", estimate},
      {"sync_logger", logger, "SCENE", "--csv", beam_},
      {"sync_logger", {beam_, "--csv", out}, "--csv", "--record", out},
      {"sync_logger", {beam_, "--key", key_}, "--key", "--record", key_},
      // The logger also writes F_now.csv.
      {"sync_logger", {beam_, "--csv", out, "--now"}, "--now", "--record", now},
      {"sync_logger", {beam_, "--csv", out, "--now"}, "--now", "--report", now},
      {"check_scene", {beam_}, "SCENE", "--report", beam_},
      {"diagnose", {events_, beam_}, "LOG", "--report", events_},
      {"diagnose", {events_, beam_}, "SCENE", "--report", beam_},
      {"identify", {events_, beam_}, "SCENE", "--output", beam_},
      {"identify", {events_, beam_}, "LOG", "--output", events_},
      {"reduce", reduce, "EVENTS", "--output", events_},
      {"reduce", reduce, "SCENE", "--output", beam_},
      {"reduce", {beam_, "--accuracy", "1e-3"}, "SCENE", "--output", beam_},
      {"import_events", {rig_, beam_}, "FILE", "--output", rig_},
      {"import_events", {rig_, beam_}, "FILE", "--report", rig_},
      {"import_events", {rig_, beam_, "--output", out}, "--output", "--report", out}};
  for (const std::string option : {"--events", "--states", "--report"}) {
    cases.push_back({"master_sim", master, "SCENE", option, beam_});
    cases.push_back({"master_sim", master + Arguments{"--key", key_}, "--key", option, key_});
  }
  for (const std::string option : {"--states", "--events", "--impacts", "--report"}) {
    cases.push_back({"observer", replay, "--replay", option, events_});
    cases.push_back({"observer", replay, "SCENE", option, beam_});
    cases.push_back({"observer", replay + Arguments{"--key", key_}, "--key", option, key_});
  }
  for (const auto& [program, arguments, first, option, same] : cases)
    expect_refused(program, arguments + Arguments{option, same}, first, option);
  set_url("file://" + out + "?mode=w");
  expect_refused("master_sim", {beam_, "--duration", "1", "--events", out}, "--url", "--events");
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_FALSE(std::filesystem::exists(now));
  EXPECT_EQ(read_text(estimate), read_text(truth_));
}

// Matrix and vector files named in a scene are inputs, too.
TEST_F(OverwriteTest, FilesNamedInSceneAreInputs) {
  const std::string mass = "2,0\n0,1\n", start = "0.5\n0\n";
  std::filesystem::create_directory(file("rig"));
  const std::string M = write_text(file("rig/M.csv"), mass);
  const std::string q = write_text(file("rig/q.csv"), start);
  const std::string text = R"(name = "rig.csv"
system = { M = "M.csv", C = [[0.2, 0], [0, 0.1]], K = [[4, -1], [-1, 3]] }
force = [{ direction = [1, 0], amplitude = 3, frequency = 1.5 }]
contact = [{ direction = [0, 1], clearance = 0.2 }]
impact = { restitution = 0.6 }
replica = { q = "q.csv" }
)";
  const std::string rig = write_text(file("rig/rig.toml"), text);
  std::filesystem::create_symlink("M.csv", file("rig/soft.csv"));
  std::filesystem::create_hard_link(q, file("hard.csv"));
  const std::string log = write_text(file("rig/log.csv"), "t,contact,closed\n1,1,1\n1,1,0\n");
  const auto refused = [&](const std::string& program, const Arguments& arguments,
                           const std::string& option) {
    expect_refused(program, arguments, "a file of SCENE", option);
    EXPECT_EQ(read_text(M), mass);
    EXPECT_EQ(read_text(q), start);
  };
  const Arguments simulated{rig, "--no-lcm", "--speed", "max", "--duration", "1"};
  for (const std::string& output : {q, file("rig/soft.csv"), file("hard.csv")}) {
    refused("master_sim", simulated + Arguments{"--states", output}, "--states");
  }
  refused("observer", {rig, "--replay", log, "--states", M}, "--states");
  refused("observer", {rig, "--states", M}, "--states");
  refused("sync_logger", {rig, "--record", M}, "--record");
  refused("check_scene", {rig, "--report", M}, "--report");
  refused("diagnose", {log, rig, "--report", M}, "--report");
  refused("identify", {log, rig, "--output", M}, "--output");
  refused("reduce", {log, rig, "--modes", "1", "--output", M}, "--output");
  refused("import_events", {rig_, rig, "--output", M}, "--output");
  // No other output file is opened before the refusal.
  refused("master_sim", simulated + Arguments{"--events", file("new.csv"), "--report", M},
          "--report");
  EXPECT_FALSE(std::filesystem::exists(file("new.csv")));
  // Also with another error in the scene or the matrix.
  write_text(rig, "nme = 1\n" + text);
  refused("check_scene", {rig, "--report", q}, "--report");
  write_text(rig, text);
  write_text(M, "2,0\n0,x\n");
  expect_refused("check_scene", {rig, "--report", M}, "a file of SCENE", "--report");
  EXPECT_EQ(read_text(M), "2,0\n0,x\n");
  write_text(M, mass);
  // A scene's name is not the name of an output file.
  write_text(file("rig/rig.csv"), "");
  const Ended ended = run("master_sim", simulated + Arguments{"--states", file("rig/rig.csv")});
  EXPECT_EQ(ended.code, 0) << ended.err;
}

TEST_F(OverwriteTest, NonRegularFileMayBeGivenTwice) {
  const Ended ended = run("observer", {beam_, "--replay", events_, "--states", "/dev/null",
                                       "--events", "/dev/null", "--report", "/dev/null"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Ended piped = end_of(start_command(
      {"sh", "-c", R"("$0" "$1" --replay "$2" --states /dev/stdout --events /dev/stdout | cat)",
       OBSERVER, beam_, events_}));
  EXPECT_EQ(piped.code, 0) << piped.err;
  EXPECT_NE(piped.out.find("t,contact,closed"), std::string::npos);
  EXPECT_NE(piped.out.find("k,t,q1"), std::string::npos);
  EXPECT_EQ(contents(), before_);
}

}  // namespace
}  // namespace sprag::test
