// SIGINT, SIGTERM and SIGHUP end every program at once, with complete files and a report.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <random>

#include "lcmtypes/channel_log.h"
#include "sprag/detail/files/events_writer.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

constexpr auto at_once = sanitized ? 20s : 2s;

using HangUpTest = EndToEnd;

class SignalTest : public EndToEnd, public testing::WithParamInterface<int> {
 protected:
  void expect_clean_end(Process& process) { expect_end(process, 0); }

  Ended expect_end(Process& process, int code) {
    EXPECT_TRUE(process.running()) << process.label();
    process.signal(GetParam());
    const Ended ended = end_of(process, at_once);
    EXPECT_EQ(ended.code, code) << process.label() << '\n' << ended.err;
    return ended;
  }

  /// Waits until the program is in its long computation.
  void expect_still_at_work(Process& process) {
    EXPECT_FALSE(eventually([&] { return !process.running(); }, sanitized ? 3s : 500ms));
  }

  /// The paper's beam with an excitation so fast that the event search does not end.
  std::string endless_beam() {
    std::string text = read_text(scene("paper_beam"));
    const std::string frequency = "frequency = 9.5";
    text.replace(text.find(frequency), frequency.size(), "frequency = 1e12");
    return write_text(file("endless.toml"), text);
  }
};

TEST_P(SignalTest, EndsARunningProgramWithCompleteFiles) {
  const Arguments common{scene("paper_beam")};
  Process& logger = start_listening(
      "sync_logger", common + Arguments{"--csv", file("sync.csv"), "--record", file("run.lcmlog"),
                                        "--report", file("logger.json")});
  Process& observer = start_listening(
      "observer", common + Arguments{"--tick", "0.015625", "--states", file("states.csv"),
                                     "--report", file("observer.json")});
  Process& master = start_master(
      common + Arguments{"--tick", "0.015625", "--speed", "20", "--events", file("events.csv"),
                         "--states", file("truth.csv"), "--report", file("master.json")});
  wait_for_time(master, 10.0);
  expect_clean_end(observer);
  expect_clean_end(logger);
  expect_clean_end(master);

  EXPECT_GT(read_states_file(file("states.csv")).size(), 100U);
  EXPECT_GT(read_states_file(file("truth.csv")).size(), 100U);
  EXPECT_GT(read_sync(file("sync.csv")).size(), 100U);
  const EventsFile events = read_events(file("events.csv"), 1);
  EXPECT_FALSE(events.damage);
  EXPECT_TRUE(events.skipped.empty());
  EXPECT_GT(events.events.size(), 10U);
  ChannelLogReader log(file("run.lcmlog"));
  ChannelRecord record;
  int records = 0;
  while (log.next(record)) ++records;
  EXPECT_TRUE(log.damages().empty());
  EXPECT_GT(records, 100);
  for (const char* report : {"logger.json", "observer.json", "master.json"}) {
    EXPECT_TRUE(text(report).ends_with('\n')) << report;
    EXPECT_EQ(json(report).value("exit", -1), 0) << report;
  }
}

class AnySignalTest : public SignalTest {};
INSTANTIATE_TEST_SUITE_P(All, AnySignalTest, testing::Values(SIGINT, SIGTERM, SIGHUP));
INSTANTIATE_TEST_SUITE_P(Term, SignalTest, testing::Values(SIGTERM));

TEST_P(AnySignalTest, EndsProgramWithoutMessages) {
  Process& observer =
      start_listening("observer", {scene("paper_beam"), "--states", file("states.csv")});
  Process& logger =
      start_listening("sync_logger", {scene("paper_beam"), "--csv", file("sync.csv")});
  expect_clean_end(observer);
  expect_clean_end(logger);
  EXPECT_TRUE(read_states_file(file("states.csv")).empty());
  EXPECT_TRUE(read_sync(file("sync.csv")).empty());
}

TEST_P(SignalTest, EndsAnUnpacedMaster) {
  Process& master = start_master({scene("paper_beam"), "--no-lcm", "--speed", "max", "--duration",
                                  "1e8", "--events", file("events.csv")});
  expect_clean_end(master);
  EXPECT_FALSE(read_events(file("events.csv"), 1).damage);
}

TEST_P(SignalTest, EndsMasterWithVeryFrequentEvents) {
  std::ofstream(file("crowd.toml")) << R"(
[system]
M = [[1.0]]
C = [[0.0]]
K = [[1e18]]
[impact]
restitution = 1.0
[[contact]]
direction = [1.0]
[master]
q = [1.0]
)";
  Process& master = start_master({file("crowd.toml"), "--no-lcm", "--speed", "max", "--duration",
                                  "1", "--events", file("events.csv")});
  EXPECT_TRUE(in_time([&] {
    return std::filesystem::exists(file("events.csv")) &&
           std::filesystem::file_size(file("events.csv")) > 1000;
  }));
  expect_clean_end(master);
  EXPECT_GT(read_events(file("events.csv"), 1).events.size(), 100U);
}

TEST_P(SignalTest, EndsAMasterInItsEventSearch) {
  Process& master = start_master({endless_beam(), "--events", file("events.csv"), "--states",
                                  file("truth.csv"), "--report", file("report.json")});
  expect_still_at_work(master);
  expect_clean_end(master);
  EXPECT_FALSE(read_events(file("events.csv"), 1).damage);
  (void)read_states_file(file("truth.csv"));
  EXPECT_EQ(json("report.json").value("exit", -1), 0);
}

TEST_P(SignalTest, EndsAReplayInItsEventSearch) {
  // A resting weight, shaken so fast that the search for its release takes long.
  std::ofstream(file("weight.toml")) << R"(
[system]
M = [[1.0]]
C = [[0.2]]
K = [[1.0]]
[[force]]
direction = [1.0]
constant = -9.81
amplitude = 9.0
frequency = 1e12
[[contact]]
direction = [1.0]
[impact]
restitution = 0.5
[master]
q = [0.3]
[replica]
q = [1.0]
)";
  const std::string events = write_text(file("events.csv"), "t,contact,closed\n0.5,1,1\n");
  Process& observer =
      start("observer", {file("weight.toml"), "--replay", events, "--duration", "10", "--states",
                         file("states.csv"), "--report", file("report.json")});
  expect_still_at_work(observer);
  expect_clean_end(observer);
  (void)read_states_file(file("states.csv"));
  EXPECT_EQ(json("report.json").value("exit", -1), 0);
}

TEST_P(SignalTest, EndsACheckOfAScene) {
  Process& check = start("check_scene", {endless_beam(), "--report", file("report.json")});
  expect_still_at_work(check);
  const Ended ended = expect_end(check, 1);
  EXPECT_NE(ended.err.find("interrupted"), std::string::npos) << ended.err;
  EXPECT_EQ(json("report.json").value("exit", -1), 1);
}

// Random pulses.
std::string write_pulses(const std::string& file, int count) {
  std::mt19937_64 random(7);
  std::exponential_distribution<double> flight(1.0);
  EventsWriter events(file);
  double t = 0.0;
  for (int i = 0; i < count; ++i) events.write({t += flight(random), 0, ContactEventKind::pulse});
  EXPECT_TRUE(events.close());
  return file;
}

TEST_P(SignalTest, EndsAReduction) {
  Process& reduce = start("reduce", {write_pulses(file("random.csv"), 500000), scene("stiff_beam"),
                                     "--modes", "10", "--output", file("reduced.toml")});
  expect_still_at_work(reduce);
  const Ended ended = expect_end(reduce, 1);
  EXPECT_NE(ended.err.find("interrupted"), std::string::npos) << ended.err;
  EXPECT_FALSE(std::filesystem::exists(file("reduced.toml")));
}

TEST_P(SignalTest, EndsADiagnosisAndAnIdentification) {
  write_pulses(file("random.csv"), 20000);
  for (const char* program : {"diagnose", "identify"}) {
    Process& process =
        start(program, {file("random.csv"), scene("paper_beam"), "--report", file("report.json")});
    expect_still_at_work(process);
    const Ended ended = expect_end(process, 1);
    EXPECT_NE(ended.err.find("interrupted"), std::string::npos) << ended.err;
    EXPECT_EQ(json("report.json").value("error", ""), "interrupted");
  }
}

TEST_P(SignalTest, KillsProgramBlockedInWrite) {
#if defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the thread sanitizer holds signals back until the program looks";
#endif
  const std::string events = simulate(scene("paper_beam"), "5", "0.1");
  ASSERT_EQ(::mkfifo(file("states.csv").c_str(), 0600), 0);
  const int nobody_reads = ::open(file("states.csv").c_str(), O_RDWR | O_CLOEXEC);
  Process& observer = start("observer", {scene("paper_beam"), "--replay", events, "--duration",
                                         "1e8", "--states", file("states.csv")});
  expect_still_at_work(observer);
  const Ended ended = expect_end(observer, 1);
  EXPECT_NE(ended.err.find("does not end by itself"), std::string::npos) << ended.err;
  ::close(nobody_reads);
}

TEST_F(HangUpTest, IgnoredHangUpStaysIgnored) {
  Process& observer = start_command({"sh", "-c", R"(trap '' HUP; exec "$0" "$1" --url "$2")",
                                     OBSERVER, scene("paper_beam"), url()});
  EXPECT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  observer.signal(SIGHUP);
  EXPECT_FALSE(eventually([&] { return !observer.running(); }, 500ms));
  observer.signal(SIGTERM);
  EXPECT_EQ(end_of(observer, at_once).code, 0);
}

TEST_P(SignalTest, EndsAProgramThatWaitsForItsInput) {
  const std::string pipe = file("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int nobody_writes = ::open(pipe.c_str(), O_RDWR | O_CLOEXEC);
  const std::string beam = scene("paper_beam");
  Process& observer = start("observer", {beam, "--replay", pipe, "--states", file("states.csv")});
  Process& logger =
      start("sync_logger", {beam, "--truth", pipe, "--estimate", pipe, "--csv", file("sync.csv")});
  Process& diagnose = start("diagnose", {pipe, beam});
  Process& import = start("import_events", {pipe, beam});
  expect_still_at_work(observer);
  expect_clean_end(observer);
  EXPECT_TRUE(read_states_file(file("states.csv")).empty());
  expect_clean_end(logger);
  expect_end(diagnose, 1);
  expect_end(import, 1);
  ::close(nobody_writes);
}

TEST_P(SignalTest, EndsAReplay) {
  simulate(scene("paper_beam"), "5", "0.1");
  Process& observer = start("observer", {scene("paper_beam"), "--replay", file("events.csv"),
                                         "--duration", "1e8", "--states", file("states.csv")});
  EXPECT_TRUE(in_time([&] {
    return std::filesystem::exists(file("states.csv")) &&
           std::filesystem::file_size(file("states.csv")) > 1000;
  }));
  expect_clean_end(observer);
  EXPECT_GT(read_states_file(file("states.csv")).size(), 10U);
}

}  // namespace
}  // namespace sprag::test
