// Would catch an observer that loses ticks while it is stopped, or ends at a full disk.
#include <csignal>
#include <cstdlib>
#include <thread>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class HardshipTest : public EndToEnd {
 protected:
  void start_all() {
    logger_ = &start_listening("sync_logger", common_ + Arguments{"--csv", file("sync.csv"),
                                                                  "--report", file("sync.json")});
    observer_ = &start_listening(
        "observer", common_ + Arguments{"--tick", "0.015625", "--states", file("live.csv"),
                                        "--report", file("o.json")});
    master_ = &start_master(
        common_ + Arguments{"--tick", "0.015625", "--speed", "15", "--events", file("events.csv")});
    wait_for_time(*master_, 14.0);
  }

  const Arguments common_{scene("paper_beam"), "--duration", "90"};
  Process* logger_ = nullptr;
  Process* observer_ = nullptr;
  Process* master_ = nullptr;
};

TEST_F(HardshipTest, ObserverSuspendedForTwoSecondsSettlesTheSameTicks) {
  start_all();
  observer_->signal(SIGSTOP);
  std::this_thread::sleep_for(2s);
  observer_->signal(SIGCONT);
  EXPECT_EQ(end_of(*master_).code, 0);
  EXPECT_EQ(end_of(*observer_).code, 0);
  EXPECT_EQ(end_of(*logger_).code, 0);
  EXPECT_TRUE(text("live.csv") == read_text(replay(scene("paper_beam"), file("events.csv"),
                                                   {"--tick", "0.015625", "--duration", "90"})))
      << "live differs from the replay";
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report["sessions"], 1);
  EXPECT_EQ(report["unsettled_ticks"], 0);
  EXPECT_EQ(read_sync(file("sync.csv")).back().k, 5760);
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

class FullDiskTest : public HardshipTest {
 protected:
  bool permitted() {
    return std::system("unshare -rm mount -t tmpfs tmpfs /tmp > /dev/null 2>&1") == 0;
  }
};

TEST_F(FullDiskTest, ObserverContinuesWithoutItsFile) {
  if (!permitted()) GTEST_SKIP() << "no file system may be mounted here";
  Process& observer = start_command(on_a_small_disk(
      file("small"), file("kept"),
      {OBSERVER, scene("paper_beam"), "--duration", "90", "--tick", "0.015625", "--url", url(),
       "--states", file("small/states.csv"), "--report", file("o.json")}));
  ASSERT_TRUE(in_time([&] { return observer.err().find("listening") != std::string::npos; }));
  Process& master = start_master(common_ + Arguments{"--tick", "0.015625", "--speed", "30"});
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
