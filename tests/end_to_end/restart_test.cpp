// Observers that join late, programs that end and restart.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class RestartTest : public EndToEnd {
 protected:
  Arguments observer_arguments(const std::string& states) const {
    return common_ + Arguments{"--tick", "0.015625", "--states", file(states)};
  }
  Arguments master_arguments() const {
    return common_ +
           Arguments{"--tick", "0.015625", "--speed", "20", "--events", file("events.csv")};
  }
  Process& start_logger() {
    return start_listening("sync_logger", common_ + Arguments{"--csv", file("sync.csv"), "--report",
                                                              file("sync.json")});
  }

  /// V of the rows from tick k on falls by at least the factor.
  void expect_convergence_from(std::int64_t k, double factor) {
    const std::vector<SyncLine> rows = read_sync(file("sync.csv"));
    const auto first = std::ranges::find_if(rows, [&](const SyncLine& row) { return row.k >= k; });
    ASSERT_NE(first, rows.end());
    EXPECT_GT(first->v, 0.0);
    EXPECT_LT(rows.back().v, factor * first->v) << "V " << first->v << " at k " << first->k << ", "
                                                << rows.back().v << " at " << rows.back().k;
  }

  // More than 120 records by t = 25 (below), so that a late observer cannot start at t = 0.
  const Arguments common_{scene("paper_beam_chatter"), "--duration", "80"};
};

// B is finite from the observer's first tick on, up to the last `time` of the run.
TEST_F(RestartTest, ObserverThatJoinsLateHasABoundUnderTolerances) {
  const std::string machine =
      write_text(file("tolerant.toml"),
                 read_text(scene("paper_beam_chatter")) + "\n[tolerance]\ntime = 1e-6\n");
  const Arguments common{machine, "--duration", "80", "--tick", "0.015625"};
  Process& master =
      start_master(common + Arguments{"--speed", "20", "--states", file("truth.csv")});
  wait_for_time(master, 25.0);
  Process& observer = start_listening(
      "observer", common + Arguments{"--estimator", "replica", "--states", file("states.csv")});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  EXPECT_EQ(run("sync_logger", {machine, "--truth", file("truth.csv"), "--estimate",
                                file("states.csv"), "--csv", file("sync.csv")})
                .code,
            0);
  const std::vector<SyncLine> V = read_sync(file("sync.csv"));
  const std::vector<double> B = read_column(file("states.csv"), "B");
  ASSERT_EQ(V.size(), B.size());
  EXPECT_GE(V.front().k, 1600);
  for (std::size_t k = 0; k + 1 < B.size(); ++k) {
    ASSERT_TRUE(std::isfinite(B[k])) << V[k].t;
    ASSERT_LE(V[k].v, B[k]) << V[k].t;
  }
  std::cout << "B " << B.front() << " at t = " << V.front().t << ", " << B[B.size() - 2]
            << " at the end\n";
  EXPECT_LT(B[B.size() - 2], 0.5 * B.front());
}

TEST_F(RestartTest, LateObserverStartsAtZeroIfMessageHasEveryRecord) {
  const Arguments common{scene("paper_beam"), "--duration", "50", "--tick", "0.015625"};
  Process& master =
      start_master(common + Arguments{"--speed", "20", "--events", file("events.csv")});
  wait_for_time(master, 15.0);
  Process& observer =
      start_listening("observer", common + Arguments{"--states", file("states.csv")});
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  const std::string offline =
      replay(scene("paper_beam"), file("events.csv"), {"--tick", "0.015625", "--duration", "50"});
  EXPECT_TRUE(text("states.csv") == read_text(offline)) << "live differs from the replay";
}

TEST_F(RestartTest, ObserverFollowsAMasterThatIsRestarted) {
  Process& logger = start_logger();
  Process& observer = start_listening(
      "observer", observer_arguments("states.csv") + Arguments{"--report", file("observer.json")});
  Process& first = start_master(master_arguments());
  wait_for_time(first, 10.0);
  first.kill();
  Process& second =
      start("master_sim", common_ + Arguments{"--tick", "0.015625", "--speed", "20", "--events",
                                              file("events_of_second.csv")});
  EXPECT_EQ(end_of(second).code, 0);
  const Ended ended = end_of(observer);
  EXPECT_EQ(ended.code, 0);
  EXPECT_EQ(end_of(logger).code, 0);

  EXPECT_NE(ended.err.find("new session"), std::string::npos);
  EXPECT_EQ(json("observer.json").value("sessions", 0), 2);
  EXPECT_EQ(json("sync.json").value("sessions", 0), 2);
  std::vector<SyncLine> rows = read_sync(file("sync.csv"));
  const auto jump = std::ranges::adjacent_find(
      rows, [](const SyncLine& a, const SyncLine& b) { return b.k < a.k; });
  ASSERT_NE(jump, rows.end()) << "no second session in the rows";
  const SyncLine& start = *(jump + 1);
  EXPECT_LT(start.t, 5.0);
  EXPECT_GT(start.v, 0.1);
  EXPECT_LT(rows.back().v, 1e-3 * start.v);
  // The second session's settled ticks are those of the replay of its events.
  const std::string offline =
      read_text(replay(scene("paper_beam_chatter"), file("events_of_second.csv"),
                       {"--tick", "0.015625", "--duration", "80"}));
  const std::string ticks = offline.substr(offline.find('\n') + 1);
  EXPECT_TRUE(text("states.csv").ends_with("\n" + ticks));
}

}  // namespace
}  // namespace sprag::test
