// Observers that join late, programs that end and restart.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

using RestartTest = EndToEnd;

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

}  // namespace
}  // namespace sprag::test
