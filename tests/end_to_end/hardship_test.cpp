// Would catch an observer that loses ticks while it is stopped, or ends at a full disk.
#include <csignal>
#include <cstdlib>
#include <thread>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

const Arguments beam_to_90{scene("paper_beam"), "--duration", "90"};
const Arguments in_ticks{"--tick", "0.015625"};

using HardshipTest = EndToEnd;

TEST_F(HardshipTest, ObserverSuspendedForTwoSecondsSettlesTheSameTicks) {
  Process& observer = start_listening(
      "observer",
      beam_to_90 + in_ticks + Arguments{"--states", file("live.csv"), "--report", file("o.json")});
  Process& master = start_master(beam_to_90 + in_ticks +
                                 Arguments{"--speed", "15", "--events", file("events.csv")});
  wait_for_time(master, 14.0);
  observer.signal(SIGSTOP);
  std::this_thread::sleep_for(2s);
  observer.signal(SIGCONT);
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  EXPECT_TRUE(text("live.csv") == read_text(replay(beam_to_90[0], file("events.csv"),
                                                   in_ticks + Arguments{"--duration", "90"})))
      << "live differs from the replay";
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["sessions"], 1);
  EXPECT_EQ(report["unsettled_ticks"], 0);
  EXPECT_GE(report["real_time"]["losses"], 1);
  EXPECT_GT(report["real_time"]["lost_s"], 1.0);
}

/// The command, with `small` as a file system of 256 KiB whose files are copied to `kept`
/// afterwards.
Arguments on_a_small_disk(const std::string& small, const std::string& kept,
                          const Arguments& command) {
  std::string line = "mkdir -p " + small + " " + kept + " && mount -t tmpfs -o size=256k tmpfs " +
                     small + " && touch " + kept + "/mounted && (\"$@\"); code=$?; cp " + small +
                     "/* " + kept + "; exit $code";
  return Arguments{"unshare", "-rm", "sh", "-c", line, "sh"} + command;
}

TEST_F(HardshipTest, ObserverContinuesWithoutItsFileOnAFullDisk) {
  if (std::system("unshare -rm mount -t tmpfs tmpfs /tmp > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "no file system may be mounted here";
  Process& observer = start_command(on_a_small_disk(
      file("small"), file("kept"),
      {OBSERVER, scene("paper_beam"), "--duration", "90", "--tick", "0.015625", "--url", url(),
       "--states", file("small/states.csv"), "--report", file("o.json")}));
  ASSERT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  Process& master = start_master(beam_to_90 + in_ticks + Arguments{"--speed", "30"});
  EXPECT_EQ(end_of(master).code, 0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("No space left on device"), std::string::npos) << ended.err;
  EXPECT_EQ(json("o.json")["ticks"], 5761);
  const std::size_t rows = read_states_file(file("kept/states.csv")).size();
  EXPECT_GT(rows, 500U);
  EXPECT_LT(rows, 5761U);
}

}  // namespace
}  // namespace sprag::test
