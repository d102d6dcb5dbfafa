// SIGINT, SIGTERM and SIGHUP end every program at once, with complete files and a report.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <random>

#include "lcmtypes/channel_log.h"
#include "sprag/detail/files/events_writer.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

constexpr auto at_once = sanitized ? 20s : 2s;

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

class SignalTest : public EndToEnd {
 protected:
  Ended expect_end(Process& process, int code, int signal = SIGTERM) {
    EXPECT_TRUE(process.running()) << process.label();
    process.signal(signal);
    const Ended ended = end_of(process, at_once);
    EXPECT_EQ(ended.code, code) << process.label() << '\n' << ended.err;
    return ended;
  }

  /// Waits until the program is in its long computation.
  void expect_still_at_work(Process& process) {
    EXPECT_FALSE(eventually([&] { return !process.running(); }, sanitized ? 3s : 300ms));
  }
};

TEST_F(SignalTest, EndsARunningProgramWithCompleteFiles) {
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
  expect_end(observer, 0);
  expect_end(logger, 0);
  expect_end(master, 0);

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

// Each in its longest computation: many and very frequent events, the event search, fits. A run up
// to a signal has succeeded, a computation that is cut short has failed.
TEST_F(SignalTest, EndsALongComputation) {
  const std::string beam = scene("paper_beam"), events = simulate(beam, "5", "0.1");
  std::string text = read_text(beam);
  const std::string frequency = "frequency = 9.5";
  const std::string endless =
      write_text(file("endless.toml"),
                 text.replace(text.find(frequency), frequency.size(), "frequency = 1e12"));
  const std::string crowd = write_text(file("crowd.toml"), R"(
system = { M = [[1]], C = [[0]], K = [[1e18]] }
impact = { restitution = 1 }
contact = [{ direction = [1] }]
master = { q = [1] }
)");
  // A resting weight, shaken so fast that the search for its release takes long.
  const std::string weight = write_text(file("weight.toml"), R"(
system = { M = [[1]], C = [[0.2]], K = [[1]] }
force = [{ direction = [1], constant = -9.81, amplitude = 9, frequency = 1e12 }]
contact = [{ direction = [1] }]
impact = { restitution = 0.5 }
master = { q = [0.3] }
replica = { q = [1] }
)");
  const std::string closing = write_text(file("closing.csv"), "t,contact,closed\n0.5,1,1\n");
  const std::string pulses = write_pulses(file("pulses.csv"), 20000);
  const std::string many = write_pulses(file("many.csv"), 500000);
  const std::string out = file("out.csv"), states = file("states.csv");
  const Arguments unpaced{"--no-lcm", "--speed", "max", "--events", out};
  struct Case {
    std::string program;
    Arguments arguments;
    int code;
  };
  for (const auto& [program, arguments, code] : std::vector<Case>{
           {"master_sim", Arguments{beam, "--duration", "1e8"} + unpaced, 0},
           {"master_sim", Arguments{crowd, "--duration", "1"} + unpaced, 0},
           {"master_sim", {endless, "--events", out, "--states", states}, 0},
           {"observer", {beam, "--replay", events, "--duration", "1e8", "--states", states}, 0},
           {"observer", {weight, "--replay", closing, "--duration", "10", "--states", states}, 0},
           {"check_scene", {endless}, 1},
           {"reduce", {many, scene("stiff_beam"), "--modes", "10", "--output", file("r.toml")}, 1},
           {"diagnose", {pulses, beam}, 1},
           {"identify", {pulses, beam}, 1}}) {
    std::filesystem::remove(out);
    std::filesystem::remove(states);
    Arguments all = arguments;
    if (program != "reduce") all = all + Arguments{"--report", file("report.json")};
    Process& process = start(program, all);
    expect_still_at_work(process);
    const Ended ended = expect_end(process, code, SIGTERM);
    EXPECT_EQ(ended.err.find("interrupted") != std::string::npos, code == 1) << ended.err;
    if (program != "reduce") {
      EXPECT_EQ(json("report.json").value("exit", -1), code);
    }
    if (std::filesystem::exists(out)) {
      EXPECT_FALSE(read_events(out, 1).damage);
    }
    if (std::filesystem::exists(states)) (void)read_states_file(states);
  }
  EXPECT_FALSE(std::filesystem::exists(file("r.toml")));
}

TEST_F(SignalTest, KillsProgramBlockedInWrite) {
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

TEST_F(SignalTest, IgnoredHangUpStaysIgnored) {
  Process& observer = start_command({"sh", "-c", R"(trap '' HUP; exec "$0" "$1" --url "$2")",
                                     OBSERVER, scene("paper_beam"), url()});
  EXPECT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  observer.signal(SIGHUP);
  EXPECT_FALSE(eventually([&] { return !observer.running(); }, 500ms));
  observer.signal(SIGTERM);
  EXPECT_EQ(end_of(observer, at_once).code, 0);
}

TEST_F(SignalTest, EndsAProgramThatWaitsForItsInput) {
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
  expect_end(observer, 0);
  EXPECT_TRUE(read_states_file(file("states.csv")).empty());
  expect_end(logger, 0);
  expect_end(diagnose, 1);
  expect_end(import, 1);
  ::close(nobody_writes);
}

}  // namespace
}  // namespace sprag::test
