// A machine whose contact clock is fast and has an offset: with [clock] the observer gives the same
// estimates as from the true times, live and from recordings.
#include <cmath>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class ContactClockTest : public EndToEnd {
 protected:
  /// A shipped scene with a contact clock.
  std::string with_clock(const std::string& name) {
    return write_text(file(name + "_clock.toml"),
                      read_text(scene(name)) + "\n[clock]\nrate = 1.0002\noffset = 0.37\n")
        .string();
  }

  static void expect_near(const std::vector<StateLine>& a, const std::vector<StateLine>& b,
                          double tolerance) {
    ASSERT_EQ(a.size(), b.size());
    ASSERT_FALSE(a.empty());
    for (std::size_t k = 0; k < a.size(); ++k) {
      ASSERT_EQ(a[k].k, b[k].k);
      ASSERT_EQ(a[k].t, b[k].t);
      ASSERT_EQ(a[k].values.size(), b[k].values.size());
      for (std::size_t i = 0; i < a[k].values.size(); ++i) {
        ASSERT_NEAR(a[k].values[i], b[k].values[i], tolerance) << "tick " << k;
      }
    }
  }
};

TEST_F(ContactClockTest, LiveObserverGivesTheEstimatesOfTheTrueTimes) {
  const std::string clocked = with_clock("paper_beam");
  const Arguments how{"--tick", "0.015625", "--duration", "30"};
  Process& logger = start_recorder(file("run.lcmlog"), "SPRAG_CONTACTS");
  Process& observer =
      start_listening("observer", Arguments{clocked, "--states", file("live.csv")} + how);
  Process& master = start_master(
      Arguments{clocked, "--speed", "20", "--no-truth", "--events", file("clock.csv")} + how);
  EXPECT_EQ(end_of(master).code, 0);
  EXPECT_EQ(end_of(observer).code, 0);
  end_recorder(logger);
  // Bit for bit the same as the replays of the same events.
  const std::string live = text("live.csv");
  EXPECT_TRUE(live == read_text(replay(clocked, file("clock.csv"), how)));
  EXPECT_TRUE(live == read_text(replay(clocked, file("run.lcmlog"), how)));
  EXPECT_EQ(run("master_sim", {scene("paper_beam"), "--duration", "30", "--speed", "max",
                               "--no-lcm", "--events", file("true.csv")})
                .code,
            0);
  expect_near(read_states_file(file("live.csv")),
              read_states_file(replay(scene("paper_beam"), file("true.csv"), how)), 1e-9);
}

TEST_F(ContactClockTest, AMasterCannotGiveNegativeTimes) {
  const std::string early =
      write_text(file("early.toml"), read_text(scene("paper_beam")) + "\n[clock]\noffset = -0.1\n")
          .string();
  const Ended ended = run("master_sim", {early, "--duration", "1", "--speed", "max", "--no-lcm"});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("clock.offset is negative"), std::string::npos) << ended.err;
}

}  // namespace
}  // namespace sprag::test
