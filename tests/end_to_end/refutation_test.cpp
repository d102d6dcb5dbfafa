// A filter estimate that contradicts the guaranteed bound: `both` shows the replica, counts it and
// says so.
#include <cmath>
#include <map>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

using RefutationTest = EndToEnd;

TEST_F(RefutationTest, FalseFilterIsNotShownAndIsCountedAndNamed) {
  const std::string events = simulate(scene("paper_beam"), "200", "0.05");
  // A clearance that is wrong by 3 mm, which a stated drift hides from the gates of the filter. The
  // replica does not depend on the clearance.
  std::string misleading = read_text(scene("paper_beam"));
  for (const auto& [is, given] : std::map<std::string, std::string>{
           {"clearance = 0.0 ", "clearance = 0.003 "},
           {"uncertainty = 0.5 ", "uncertainty = 0.5\ndrift = 1e-4 "}}) {
    ASSERT_NE(misleading.find(is), std::string::npos);
    misleading.replace(misleading.find(is), is.size(), given);
  }
  const std::string guarded = write_text(
      file("guarded.toml"), misleading + "\n[tolerance]\ntime = 1e-6\nclearance = 0.003\n");
  const Ended ended =
      run("observer", {guarded, "--replay", events, "--tick", "0.05", "--duration", "200",
                       "--report", file("guarded.json"), "--states", file("guarded.csv")});
  ASSERT_EQ(ended.code, 0);
  EXPECT_NE(ended.err.find("the filter's estimate is false"), std::string::npos) << ended.err;
  const int refutations = json("guarded.json")["confidence"]["refutations"];
  EXPECT_GT(refutations, 5);
  // The replica's estimates are shown, without a sigma.
  const std::vector<double> count = read_column(file("guarded.csv"), "refutations");
  const std::vector<double> of_filter = read_column(file("guarded.csv"), "from_filter");
  const std::vector<double> sigma = read_column(file("guarded.csv"), "sigma_q1");
  EXPECT_EQ(count.back(), refutations);
  for (std::size_t k = 1; k < count.size(); ++k) {
    if (count[k] == count[k - 1]) continue;
    EXPECT_EQ(of_filter[k], 0.0) << k;
    EXPECT_TRUE(std::isinf(sigma[k])) << k;
  }
}

}  // namespace
}  // namespace sprag::test
