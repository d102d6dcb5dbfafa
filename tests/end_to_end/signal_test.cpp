// SIGINT and SIGTERM end every program at once, with complete files.
#include <algorithm>
#include <csignal>
#include <fstream>

#include "lcmtypes/channel_log.h"
#include "mechanics/events_file.h"
#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

constexpr auto at_once = sanitized ? 20s : 2s;

class SignalTest : public EndToEnd, public testing::WithParamInterface<int> {
 protected:
  void expect_clean_end(Process& process) {
    EXPECT_TRUE(process.running()) << process.label();
    process.signal(GetParam());
    EXPECT_EQ(end_of(process, at_once).code, 0) << process.label();
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
  EXPECT_FALSE(log.damage());
  EXPECT_GT(records, 100);
  for (const char* report : {"logger.json", "observer.json", "master.json"}) {
    EXPECT_TRUE(text(report).ends_with('\n')) << report;
    EXPECT_EQ(json(report).value("exit", -1), 0) << report;
  }
}

TEST_P(SignalTest, EndsAProgramThatHasHeardNothing) {
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

TEST_P(SignalTest, EndsAMasterWhereEventsCrowd) {
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

INSTANTIATE_TEST_SUITE_P(All, SignalTest, testing::Values(SIGINT, SIGTERM), [](const auto& number) {
  return std::string(number.param == SIGINT ? "SIGINT" : "SIGTERM");
});

}  // namespace
}  // namespace sprag::test
