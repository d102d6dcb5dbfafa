// A live observer and a machine that does odd things: nothing ends, deafens or misleads it without
// a word.
#include <fstream>

#include "tests/end_to_end/fixture.h"
#include "tests/end_to_end/played_master.h"

namespace sprag::test {
namespace {

using enum ContactEventKind;

class LiveTroubleTest : public EndToEnd {
 protected:
  Process& start_observer(const std::string& machine, const Arguments& more = {}) {
    return start_listening(
        "observer",
        Arguments{machine, "--states", file("live.csv"), "--report", file("o.json")} + more);
  }
};

constexpr const char* two_supports = R"([system]
M = [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,1.0]]
C = [[0.0,0.0,0.0],[0.0,0.0,0.0],[0.0,0.0,0.0]]
K = [[5.0,-1.0,-1.0],[-1.0,5.0,-1.0],[-1.0,-1.0,4.0]]
[[force]]
direction = [-1.0,-1.0,1.0]
constant = 3.0
amplitude = 0.3
frequency = 2.0
[[contact]]
direction = [1.0,0.0,0.0]
clearance = 0.2
[[contact]]
direction = [0.0,1.0,0.0]
clearance = 0.2
[impact]
law = "poisson"
restitution = 0.0
[master]
q = [0.0,0.0,0.0]
[replica]
q = [0.1,0.1,0.0]
)";

// Whatever the mechanics makes of it, no thread takes the process with it.
TEST_F(LiveTroubleTest, TwoContactsReportedClosedLeaveAReportAndWholeFiles) {
  std::ofstream(file("machine.toml")) << two_supports;
  Process& observer = start_observer(file("machine.toml"), {"--duration", "10"});
  PlayedMaster master(url(), 2, 10.0);
  master.add(std::vector<ContactEvent>{
      {0.5, 0, closes}, {0.8, 1, closes}, {9.0, 0, opens}, {9.0, 1, opens}});
  master.play_until(10.0);
  const Ended ended = end_of(observer);
  EXPECT_LE(ended.code, 1) << ended.err;
  const nlohmann::json report = json("o.json");
  EXPECT_EQ(report.value("exit", -1), ended.code);
  EXPECT_EQ(report.contains("error"), ended.code == 1);
  EXPECT_GT(report.value("settled_tick", 0), 100);
  EXPECT_EQ(read_states_file(file("live.csv")).size(),
            static_cast<std::size_t>(report.value("settled_tick", 0)) + 1);
}

}  // namespace
}  // namespace sprag::test
