// Invalid usage, invalid input and unsuitable hosts: exit codes and messages.
#include <algorithm>
#include <filesystem>
#include <tuple>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class UsageTest : public EndToEnd {
 protected:
  void expect_refused(const std::string& program, const Arguments& arguments,
                      const std::string& message) {
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 2) << program << ' ' << testing::PrintToString(arguments) << '\n'
                             << ended.err;
    EXPECT_NE(ended.err.find(message), std::string::npos)
        << program << ' ' << testing::PrintToString(arguments) << '\n'
        << ended.err;
    EXPECT_TRUE(ended.out.empty()) << ended.out;
  }

  const std::string beam_ = scene("paper_beam");
};

TEST_F(UsageTest, BadUsageAndInputAreRefusedAndHelpIsGiven) {
  const std::string bad = write_text(file("bad.toml"), "nme = 1\n" + read_text(beam_));
  const std::string folder = file(""), empty = write_text(file("empty"), "");
  const Arguments with_key{beam_, "--duration", "1", "--key"};
  for (const std::string program : {"master_sim", "observer", "sync_logger"}) {
    const Ended help = run(program, {"--help"});
    EXPECT_EQ(help.code, 0);
    for (const char* option : {"--help", "--version", "--url", "--report", "SCENE"})
      EXPECT_NE(help.out.find(option), std::string::npos) << program << ' ' << option;
    EXPECT_EQ(help.out.find("{false}"), std::string::npos) << help.out;
    EXPECT_TRUE(run(program, {"--version"}).out.starts_with(program + " "));
    expect_refused(program, {beam_, "--no-such-option"}, "--no-such-option");
    expect_refused(program, {}, "SCENE");
    expect_refused(program, {file("absent.toml")}, "absent.toml");
    expect_refused(program, {folder}, folder);
    expect_refused(program, {beam_, beam_}, beam_);
    expect_refused(program, {bad}, bad + ":1:1: unknown key nme");
    expect_refused(program, with_key + Arguments{folder}, folder + ": is a directory");
    expect_refused(program, with_key + Arguments{empty}, empty + ": is no key");
    expect_refused(program, with_key + Arguments{file("absent")}, "absent");
  }
}

TEST_F(UsageTest, OptionsThatContradictEachOtherAreRefused) {
  const std::string recorded = simulate(beam_, "5", "0.1");
  const std::string late = write_text(file("late.csv"), "t,contact,closed\n0.5,1,0\n");
  const std::string early =
      write_text(file("early.toml"), read_text(beam_) + "\n[clock]\noffset = -0.1\n");
  const std::string jittered =
      write_text(file("jittered.toml"), read_text(beam_) + "\n[events]\njitter = 1e-6\n");
  const Arguments to_file{"--states", file("smooth.csv")};
  const Arguments smooth{beam_, "--replay", recorded, "--smooth"}, smooth_to = smooth + to_file;
  for (const auto& [program, arguments, why] :
       std::vector<std::tuple<std::string, Arguments, std::string>>{
           {"master_sim", {beam_, "--speed", "max", "--no-lcm"}, "--duration"},
           {"master_sim",
            {early, "--speed", "max", "--no-lcm", "--duration", "1"},
            "clock.offset is negative"},
           {"observer", {beam_, "--events", file("events.csv")}, "--replay"},
           {"observer", {beam_, "--replay", file("absent.csv")}, "absent.csv"},
           {"observer", {beam_, "--replay", file("absent.lcmlog")}, "absent.lcmlog"},
           {"observer", {beam_, "--replay", recorded, "--key", file("")}, file("")},
           {"observer",
            {beam_, "--estimator", "kalman"},
            "--estimator: kalman; choose replica, timing, both or adaptive\n"},
           {"observer", {beam_, "--predictions", file("p.csv")}, "--predict"},
           {"observer", {beam_, "--predict", "-1"}, "--predict"},
           {"observer", {beam_, "--predict", "1", "--replay", recorded}, "--predictions"},
           {"observer", {beam_, "--predict", "1", "--estimator", "replica"}, "--predict"},
           {"observer", {beam_, "--predict", "1", "--estimator", "adaptive"}, "--predict"},
           {"observer", Arguments{beam_, "--smooth"} + to_file, "--replay"},
           {"observer", smooth, "--states"},
           {"observer", smooth_to + Arguments{"--impacts", file("i.csv")}, "--impacts"},
           {"observer", smooth_to + Arguments{"--predict", "1"}, "--predict"},
           {"observer", smooth_to + Arguments{"--estimator", "adaptive"},
            "choose --estimator both or timing"},
           {"observer", smooth_to, "event times are exact"},
           // A recording without its beginning.
           {"observer", Arguments{jittered, "--replay", late, "--smooth"} + to_file, ""},
           {"sync_logger",
            {beam_, "--truth", file("truth.csv"), "--csv", file("sync.csv")},
            "--estimate"},
           {"sync_logger", {beam_, "--now"}, "--csv"}}) {
    expect_refused(program, arguments, why);
  }
}

// With a standard stream closed at its start a program does not write its messages into the first
// file that it opens.
TEST_F(UsageTest, MessagesAreNotWrittenToOutputsIfStandardStreamsAreClosed) {
  const std::string events = simulate(beam_, "5", "0.1");
  const std::string scene_file = scene("paper_beam");
  const auto expect_same = [&](const std::string& program, const Arguments& arguments,
                               const std::vector<std::string>& outputs) {
    std::vector<std::string> expected;
    for (const char* closed : {"", "2>&-", "1>&-", "<&-", "<&- 1>&-", "<&- 1>&- 2>&-"}) {
      SCOPED_TRACE(program + ' ' + closed);
      Arguments command{"/bin/sh", "-c", std::string("exec \"$0\" \"$@\" ") + closed, program};
      command = command + arguments;
      std::vector<std::string> files;
      for (const std::string& option : outputs) {
        // The same names in every run, since the report contains the command line.
        files.push_back(file("output" + std::to_string(files.size())));
        std::filesystem::remove(files.back());
        command = command + Arguments{option, files.back()};
      }
      EXPECT_EQ(end_of(start_command(command)).code, 0);
      for (std::size_t i = 0; i < files.size(); ++i) {
        const std::string text = read_text(files[i]);
        EXPECT_GT(text.size(), 20U);
        if (*closed == '\0') {
          expected.push_back(text);
        } else {
          EXPECT_EQ(text, expected[i]) << outputs[i];
        }
      }
    }
  };
  expect_same(OBSERVER, {scene_file, "--replay", events, "--duration", "6", "--tick", "0.01"},
              {"--states", "--events", "--impacts", "--report"});
}

TEST_F(UsageTest, OutputThatCannotBeWrittenAndAFullDiskAreFailures) {
  simulate(beam_, "40", "0.1");
  const std::string events = file("events.csv"), truth = file("truth.csv");
  const std::string rig = write_text(file("times.csv"), "contact_1\n0.5\n1.5\n2.5\n");
  const Arguments master{beam_, "--no-lcm", "--speed", "max", "--duration", "5"};
  const Arguments replay{beam_, "--replay", events};
  const Arguments compare{beam_, "--truth", truth, "--estimate", truth};
  const std::vector<std::tuple<std::string, Arguments, std::string>> cases{
      {"master_sim", master, "--events"},
      {"master_sim", master, "--states"},
      {"master_sim", master, "--report"},
      {"observer", replay, "--states"},
      {"observer", replay, "--events"},
      {"observer", replay, "--report"},
      {"observer", replay, "--impacts"},
      {"observer", replay + Arguments{"--predict", "1"}, "--predictions"},
      {"sync_logger", compare, "--csv"},
      {"reduce", {beam_, "--accuracy", "1e-3"}, "--output"},
      {"reduce", {events, beam_, "--modes", "2"}, "--output"},
      {"import_events", {rig, beam_}, "--output"},
      {"identify", {events, beam_, "--free", "impact.restitution"}, "--output"}};
  std::filesystem::create_symlink("/dev/full", file("full.csv"));
  for (const std::string& bad : {file("no_such_folder/out"), file("full.csv")}) {
    for (const auto& [program, arguments, option] : cases) {
      if (program == "import_events" && bad != file("full.csv")) continue;
      SCOPED_TRACE(program + ' ' + option + ' ' + bad);
      const Ended ended = run(program, arguments + Arguments{option, bad});
      EXPECT_EQ(ended.code, 1);
      EXPECT_NE(ended.err.find(bad), std::string::npos) << ended.err;
    }
  }
  // At once, before a run.
  const std::string bad = file("no_such_folder/out");
  for (const auto& [program, arguments] : std::vector<std::pair<std::string, Arguments>>{
           {"observer", {beam_, "--duration", "1", "--states", bad}},
           {"sync_logger", {beam_, "--csv", bad}},
           {"sync_logger", {beam_, "--csv", file("sync.csv"), "--record", bad}}}) {
    const Ended ended = end_of(start(program, arguments));
    EXPECT_EQ(ended.code, 1) << program;
    EXPECT_NE(ended.err.find(bad), std::string::npos) << ended.err;
  }
}

TEST_F(UsageTest, ALogOfTheBusOnAFullDiskIsAFailure) {
  const Arguments more{beam_, "--speed", "max", "--duration", "5"};
  const auto logged = [&](const std::string& log) {
    set_url("file://" + log + "?mode=w");
    return run("master_sim", more);
  };
  const Ended full = logged("/dev/full");
  EXPECT_EQ(full.code, 1);
  EXPECT_NE(full.err.find("/dev/full: No space left on device"), std::string::npos) << full.err;
  EXPECT_EQ(logged(file("nowhere/x.lcmlog")).code, 1);
  EXPECT_EQ(logged(file("x.lcmlog")).code, 0);
  set_url("memq://");
  EXPECT_GT(read_states_file(replay(beam_, file("x.lcmlog"), {"--duration", "5"})).size(), 5000U);
}

TEST_F(UsageTest, StandardOutputThatIsFullIsAFailure) {
  simulate(beam_, "40", "0.1");
  write_text(file("times.csv"), "contact_1\n0.5\n1.5\n2.5\n");
  for (const Arguments& command :
       std::vector<Arguments>{{CHECK_SCENE, beam_},
                              {CHECK_SCENE, beam_, "--json"},
                              {OBSERVER, "--help"},
                              {OBSERVER, "--version"},
                              {DIAGNOSE, file("events.csv"), beam_},
                              {IMPORT_EVENTS, file("times.csv"), beam_}}) {
    const Ended ended = end_of(
        start_command(Arguments{"/bin/sh", "-c", "exec \"$@\" > /dev/full", "sh"} + command));
    EXPECT_EQ(ended.code, 1) << testing::PrintToString(command);
    EXPECT_NE(ended.err.find("standard output: No space left"), std::string::npos) << ended.err;
  }
}

// With any name of a scene, its file, a column or an option.
TEST_F(UsageTest, NamesAreEscapedOnTerminal) {
  const std::string events = simulate(beam_, "5", "0.1");
  const std::string escape = "\x1b]0;title\x07\x1b[31m\xc2\x9b\x7f\xff\xe2\x80\xae";
  std::string text = read_text(beam_);
  const std::string good = "name = \"paper_beam\"";
  ASSERT_NE(text.find(good), std::string::npos);
  text.replace(text.find(good), good.size(),
               R"(name = "\u001b]0;title\u0007\u009b\u007f\u202e\npaper_beam: YES")");
  const std::string hostile = write_text(file(escape + ".toml"), text);
  const std::string inside = write_text(file("inside" + escape + ".toml"),
                                        R"(name = "\u001b[31m"
system = { M = [[1]], C = [[1]], K = [[1]] }
contact = [{ direction = [1], clearance = -1 }]
impact = { restitution = 0.5 }
)");
  const std::string column =
      write_text(file("c" + escape + ".csv"), "time" + escape + "," + escape + "\n0.5,1\nx,2\n");
  const std::string damaged = write_text(file(escape + ".csv"), "t,contact,closed\n1,1," + escape);
  for (const auto& [program, arguments] : std::vector<std::pair<std::string, Arguments>>{
           {"check_scene", {hostile}},
           {"check_scene", {hostile, "--json"}},
           {"check_scene", {hostile + escape}},
           {"check_scene", {column}},
           {"diagnose", {events, hostile}},
           {"diagnose", {damaged, hostile}},
           {"identify", {events, hostile, "--free", escape}},
           {"identify", {events, hostile, "--free", "impact.restitution"}},
           {"import_events", {column, hostile}},
           {"import_events", {column, hostile, "--columns", escape}},
           {"master_sim", {hostile, "--no-lcm", "--tick", escape}},
           {"master_sim", {hostile, "--no-lcm", "--events", file(escape + "/x")}},
           {"master_sim", {inside, "--no-lcm", "--duration", "1"}},
           {"observer", {hostile, "--replay", damaged, "--duration", "1"}},
           {"observer", {hostile, "--estimator", escape}},
           {"observer", {hostile, "--" + escape}},
           {"observer", {hostile, "--url", escape}},
           {"reduce", {events, hostile, "--modes", "2"}},
           {"sync_logger", {hostile, "--truth", damaged, "--estimate", damaged}}}) {
    const Ended ended = run(program, arguments);
    for (const std::string& said : {ended.out, ended.err}) {
      for (const char c : {'\x1b', '\x07', '\x7f', '\x9b', '\xff'}) {
        EXPECT_EQ(said.find(c), std::string::npos)
            << program << ' ' << testing::PrintToString(arguments) << '\n'
            << testing::PrintToString(said);
      }
      EXPECT_EQ(said.find("\xe2\x80\xae"), std::string::npos) << program;
      EXPECT_FALSE(said.starts_with("paper_beam: ") ||
                   said.find("\npaper_beam: ") != std::string::npos)
          << program << " lets a name write a line of its own";
    }
    EXPECT_FALSE(ended.out.empty() && ended.err.empty()) << program;
  }
}

TEST_F(UsageTest, MissingMulticastRouteIsReportedWithRemedy) {
  Process& probe = start_command({"unshare", "-rn", "true"});
  if (end_of(probe).code != 0) GTEST_SKIP() << "unshare -rn is not permitted here: " << probe.err();
  for (const std::string program : {MASTER_SIM, OBSERVER, SYNC_LOGGER}) {
    const Ended ended = end_of(
        start_command({"unshare", "-rn", program, beam_, "--url", url(), "--duration", "1"}));
    EXPECT_EQ(ended.code, 1) << program;
    EXPECT_NE(ended.err.find("ip link set lo up\n"), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find("ip route add 224.0.0.0/4 dev lo"), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace sprag::test
