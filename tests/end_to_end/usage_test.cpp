// Invalid usage, invalid input and unsuitable hosts: exit codes and messages.
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>

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
  static constexpr std::array programs_{"master_sim", "observer", "sync_logger"};
};

TEST_F(UsageTest, HelpAndVersionGoToStdout) {
  for (const std::string program : programs_) {
    const Ended help = run(program, {"--help"});
    EXPECT_EQ(help.code, 0);
    for (const char* option : {"--help", "--version", "--url", "--report", "SCENE"}) {
      EXPECT_NE(help.out.find(option), std::string::npos) << program << ' ' << option;
    }
    EXPECT_EQ(help.out.find("{false}"), std::string::npos) << help.out;
    const Ended version = run(program, {"--version"});
    EXPECT_EQ(version.code, 0);
    EXPECT_TRUE(version.out.starts_with(program + " ")) << version.out;
  }
}

TEST_F(UsageTest, UnknownOptionsAndAbsentScenesAreRefused) {
  for (const std::string program : programs_) {
    expect_refused(program, {beam_, "--no-such-option"}, "--no-such-option");
    expect_refused(program, {}, "SCENE");
    expect_refused(program, {file("absent.toml")}, "absent.toml");
    expect_refused(program, {file("")}, file(""));
    expect_refused(program, {beam_, beam_}, beam_);
  }
}

TEST_F(UsageTest, OptionsThatContradictEachOtherAreRefused) {
  expect_refused("master_sim", {beam_, "--speed", "max", "--no-lcm"}, "--duration");
  expect_refused("observer", {beam_, "--events", file("events.csv")}, "--replay");
  expect_refused("observer", {beam_, "--estimator", "kalman"},
                 "--estimator: kalman; choose replica, timing, both or adaptive\n");
  const std::string recorded = simulate(beam_, "5", "0.1");
  expect_refused("observer", {beam_, "--predictions", file("p.csv")}, "--predict");
  expect_refused("observer", {beam_, "--predict", "-1"}, "--predict");
  expect_refused("observer", {beam_, "--predict", "1", "--replay", recorded}, "--predictions");
  for (const char* estimator : {"replica", "adaptive"}) {
    expect_refused("observer", {beam_, "--predict", "1", "--estimator", estimator}, "--predict");
  }
  const Arguments smooth{beam_, "--replay", recorded, "--smooth"};
  const Arguments states{"--states", file("smooth.csv")};
  expect_refused("observer", {beam_, "--smooth", "--states", file("smooth.csv")}, "--replay");
  expect_refused("observer", smooth, "--states");
  expect_refused("observer", smooth + states + Arguments{"--impacts", file("i.csv")}, "--impacts");
  expect_refused("observer", smooth + states + Arguments{"--predict", "1"}, "--predict");
  expect_refused("observer", smooth + states + Arguments{"--estimator", "adaptive"},
                 "choose --estimator both or timing");
  expect_refused("observer", smooth + states, "event times are exact");
  expect_refused("sync_logger", {beam_, "--truth", file("truth.csv"), "--csv", file("sync.csv")},
                 "--estimate");
  expect_refused("sync_logger", {beam_, "--now"}, "--csv");
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

TEST_F(UsageTest, SceneErrorsNameFileLineAndColumn) {
  std::string text = read_text(beam_);
  const std::string good = "restitution = 0.7";
  const std::size_t place = text.find(good);
  ASSERT_NE(place, std::string::npos);
  const auto line =
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(place), '\n');
  text.replace(place, good.size(), "restitution = 1.2");
  const std::string bad = write_text(file("bad.toml"), text);
  const std::string message =
      bad + ":" + std::to_string(line) + ":15: impact.restitution is 1.2; must be in [0, 1]";
  for (const std::string program : programs_) expect_refused(program, {bad}, message);
  text.replace(place, good.size(), "restitutoin = 0.7");
  write_text(file("bad.toml"), text);
  for (const std::string program : programs_) {
    expect_refused(program, {bad}, bad + ":" + std::to_string(line) + ":");
  }
  write_text(file("bad.toml"), "[beam\n");
  for (const std::string program : programs_) expect_refused(program, {bad}, bad + ":1:");
}

TEST_F(UsageTest, AbsentInputFilesAreRefused) {
  expect_refused("observer", {beam_, "--replay", file("absent.csv")}, "absent.csv");
  expect_refused("observer", {beam_, "--replay", file("absent.lcmlog")}, "absent.lcmlog");
  expect_refused("sync_logger",
                 {beam_, "--truth", file("absent.csv"), "--estimate", file("absent.csv"), "--csv",
                  file("sync.csv")},
                 "absent.csv");
}

TEST_F(UsageTest, InvalidKeyIsRefused) {
  const std::string folder = file("");
  const std::string empty = write_text(file("empty"), "");
  for (const std::string program : programs_) {
    expect_refused(program, {beam_, "--duration", "1", "--key", folder},
                   folder + ": is a directory");
    expect_refused(program, {beam_, "--duration", "1", "--key", empty}, empty + ": is no key");
    expect_refused(program, {beam_, "--duration", "1", "--key", file("absent")}, "absent");
  }
  expect_refused("observer", {beam_, "--replay", empty, "--key", folder}, folder);
}

TEST_F(UsageTest, OutputThatCannotBeWrittenIsAFailure) {
  const std::string bad = file("no_such_folder/out");
  simulate(beam_, "1", "0.1");
  const Arguments master{beam_, "--no-lcm", "--speed", "max", "--duration", "1"};
  const Arguments observer{beam_, "--replay", file("events.csv")};
  const Arguments logger{beam_, "--truth", file("truth.csv"), "--estimate", file("truth.csv")};
  const std::vector<std::pair<std::string, Arguments>> cases{
      {"master_sim", master + Arguments{"--events", bad}},
      {"master_sim", master + Arguments{"--states", bad}},
      {"master_sim", master + Arguments{"--report", bad}},
      {"observer", observer + Arguments{"--states", bad}},
      {"observer", observer + Arguments{"--events", bad}},
      {"observer", observer + Arguments{"--report", bad}},
      {"observer", {beam_, "--duration", "1", "--states", bad}},
      {"sync_logger", logger + Arguments{"--csv", bad}},
      {"sync_logger", {beam_, "--csv", bad}},
      {"sync_logger", {beam_, "--csv", file("sync.csv"), "--record", bad}},
  };
  for (const auto& [program, arguments] : cases) {
    Process& process = start(program, arguments);
    const Ended ended = end_of(process, sanitized ? 20s : 3s);
    EXPECT_EQ(ended.code, 1) << program << ' ' << testing::PrintToString(arguments);
    EXPECT_NE(ended.err.find(bad), std::string::npos)
        << program << ' ' << testing::PrintToString(arguments) << '\n'
        << ended.err;
  }
}

TEST_F(UsageTest, FullDiskIsAFailure) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  simulate(beam_, "40", "0.1");
  std::filesystem::create_symlink("/dev/full", file("full.csv"));
  write_text(file("times.csv"), "contact_1\n0.5\n1.5\n2.5\n");
  for (const auto& [program, arguments] : std::vector<std::pair<std::string, Arguments>>{
           {"master_sim",
            {beam_, "--no-lcm", "--speed", "max", "--duration", "5", "--events", "/dev/full"}},
           {"master_sim",
            {beam_, "--no-lcm", "--speed", "max", "--duration", "5", "--states", "/dev/full"}},
           {"observer", {beam_, "--replay", file("events.csv"), "--states", "/dev/full"}},
           {"observer", {beam_, "--replay", file("events.csv"), "--events", "/dev/full"}},
           {"observer", {beam_, "--replay", file("events.csv"), "--report", "/dev/full"}},
           {"observer", {beam_, "--replay", file("events.csv"), "--impacts", "/dev/full"}},
           {"observer",
            {beam_, "--replay", file("events.csv"), "--predict", "1", "--predictions",
             "/dev/full"}},
           {"sync_logger",
            {beam_, "--truth", file("truth.csv"), "--estimate", file("truth.csv"), "--csv",
             "/dev/full"}},
           {"reduce", {beam_, "--accuracy", "1e-3", "--output", "/dev/full"}},
           {"import_events", {file("times.csv"), beam_, "--output", file("full.csv")}},
           {"identify",
            {file("events.csv"), beam_, "--free", "impact.restitution", "--output", "/dev/full"}},
           {"reduce", {file("events.csv"), beam_, "--modes", "2", "--output", "/dev/full"}}}) {
    const Ended ended = run(program, arguments);
    EXPECT_EQ(ended.code, 1) << program << ' ' << testing::PrintToString(arguments);
    EXPECT_NE(ended.err.find(arguments.back()), std::string::npos)
        << program << ' ' << testing::PrintToString(arguments) << '\n'
        << ended.err;
  }
}

TEST_F(UsageTest, ALogOfTheBusOnAFullDiskIsAFailure) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
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
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
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
[system]
M = [[1]]
C = [[1]]
K = [[1]]
[[contact]]
direction = [1]
clearance = -1
[impact]
restitution = 0.5
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

TEST_F(UsageTest, TimesBeyondTickRangeDoNotHang) {
  const std::string far =
      write_text(file("far.csv"), "t,contact,closed\n1.0,1,1\n1.0,1,0\n1e300,1,1\n");
  run("observer", {beam_, "--replay", far, "--duration", "2", "--states", file("states.csv")});
  EXPECT_GE(read_states_file(file("states.csv")).size(), 2000U);
}

TEST_F(UsageTest, MissingMulticastRouteIsReportedWithRemedy) {
  Process& probe = start_command({"unshare", "-rn", "true"});
  if (end_of(probe).code != 0) GTEST_SKIP() << "unshare -rn is not permitted here: " << probe.err();
  for (const std::string program : {MASTER_SIM, OBSERVER, SYNC_LOGGER}) {
    const auto start = std::chrono::steady_clock::now();
    Process& process =
        start_command({"unshare", "-rn", program, beam_, "--url", url(), "--duration", "1"});
    const Ended ended = end_of(process, sanitized ? 20s : 5s);
    const auto wall = std::chrono::steady_clock::now() - start;
    EXPECT_EQ(ended.code, 1) << program;
    EXPECT_LT(wall, sanitized ? 10s : 2s) << program;
    EXPECT_NE(ended.err.find("ip link set lo up\n"), std::string::npos) << ended.err;
    EXPECT_NE(ended.err.find("ip route add 224.0.0.0/4 dev lo"), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace sprag::test
