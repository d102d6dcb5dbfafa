// A filter estimate that contradicts the guaranteed bound: `both` shows the replica, counts it and
// says so.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>

#include "tests/end_to_end/fixture.h"

namespace sprag::test {
namespace {

class RefutationTest : public EndToEnd {
 protected:
  /// paper_beam with a clearance that is wrong by 3 mm, which a stated drift hides from the gates
  /// of the filter. The replica does not depend on the clearance.
  std::string misleading_scene(const std::string& name, const std::string& more) {
    std::string text = read_text(scene("paper_beam"));
    for (const auto& [is, given] : std::map<std::string, std::string>{
             {"clearance = 0.0 ", "clearance = 0.003 "},
             {"uncertainty = 0.5 ", "uncertainty = 0.5\ndrift = 1e-4 "}}) {
      EXPECT_NE(text.find(is), std::string::npos);
      text.replace(text.find(is), is.size(), given);
    }
    return write_text(file(name), text + more);
  }
  /// Share of the claimed values of q that are off by more than 5 of their sigma.
  double false_share(const std::string& states) {
    std::size_t claimed = 0, false_ones = 0;
    for (const char* number : {"1", "2", "3"}) {
      const std::vector<double> q = read_column(states, std::string("q") + number);
      const std::vector<double> sigma = read_column(states, std::string("sigma_q") + number);
      const std::vector<double> truth = read_column(file("truth.csv"), std::string("q") + number);
      EXPECT_EQ(q.size(), truth.size());
      for (std::size_t k = 0; k < std::min(q.size(), truth.size()); ++k) {
        if (!std::isfinite(sigma[k])) continue;
        ++claimed;
        if (std::abs(q[k] - truth[k]) > 5.0 * sigma[k]) ++false_ones;
      }
    }
    return static_cast<double>(false_ones) / static_cast<double>(std::max<std::size_t>(claimed, 1));
  }
};

TEST_F(RefutationTest, FalseFilterIsNotShownAndIsCountedAndNamed) {
  const std::string events = simulate(scene("paper_beam"), "200", "0.05");
  const Arguments common{"--replay", events, "--tick", "0.05", "--duration", "200", "--report"};
  const std::string trusting = misleading_scene("trusting.toml", "");
  ASSERT_EQ(run("observer", Arguments{trusting} + common +
                                Arguments{file("trusting.json"), "--states", file("trusting.csv")})
                .code,
            0);
  const std::string guarded =
      misleading_scene("guarded.toml", "\n[tolerance]\ntime = 1e-6\nclearance = 0.003\n");
  const Ended ended =
      run("observer", Arguments{guarded} + common +
                          Arguments{file("guarded.json"), "--states", file("guarded.csv")});
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
  const double without = false_share(file("trusting.csv"));
  const double with = false_share(file("guarded.csv"));
  std::cout << refutations << " refutations; values beyond 5 sigma: " << without << " without, "
            << with << " with the bound\n";
  EXPECT_GT(without, 0.01);
  EXPECT_LT(with, 0.7 * without);
}

}  // namespace
}  // namespace sprag::test
