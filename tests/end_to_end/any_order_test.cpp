// The three programs may start in any order.
#include <algorithm>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

// Letters: m(aster), o(bserver), l(ogger).
class AnyOrderTest : public EndToEnd, public testing::WithParamInterface<const char*> {};

TEST_P(AnyOrderTest, RunSucceedsAndWritesRows) {
  const Arguments common{scene("paper_beam"), "--duration", "40"};
  std::vector<Process*> all;
  for (const char which : std::string(GetParam())) {
    if (which == 'm') {
      all.push_back(&start_master(common + Arguments{"--tick", "0.015625", "--speed", "20"}));
    } else if (which == 'o') {
      all.push_back(&start_listening(
          "observer", common + Arguments{"--tick", "0.015625", "--states", file("states.csv")}));
    } else {
      all.push_back(&start_listening("sync_logger", common + Arguments{"--csv", file("sync.csv")}));
    }
  }
  for (Process* process : all) EXPECT_EQ(end_of(*process).code, 0) << process->label();

  const std::vector<StateLine> states = read_states_file(file("states.csv"));
  ASSERT_EQ(states.size(), 2561U);  // fewer than 120 records: complete from t = 0 in any order
  EXPECT_EQ(states.front().k, 0);
  const std::vector<SyncLine> rows = read_sync(file("sync.csv"));
  ASSERT_GT(rows.size(), 200U);
  EXPECT_LT(rows.back().v, 1e-2);
}

INSTANTIATE_TEST_SUITE_P(All, AnyOrderTest, testing::Values("mlo", "olm"),
                         [](const auto& order) { return std::string(order.param); });

}  // namespace
}  // namespace sprag::test
