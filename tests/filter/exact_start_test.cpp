// With exact events of the scene's own machine and the machine's own start, neither the filter
// alone nor the one beside a replica reports an inconsistency.
#include <gtest/gtest.h>

#include <string>

#include "tests/support/exact_machines.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

class ExactStart : public testing::TestWithParam<MachineKind> {};

TEST_P(ExactStart, IsNeverInconsistent) {
  constexpr int drawn = 50;
  int runs = 0, events = 0;
  for (std::uint64_t seed = 1; runs < repetitions(drawn); ++seed) {
    Random random(1000 * static_cast<std::uint64_t>(GetParam()) + seed);
    const Scene scene = exact_scene(random, GetParam());
    const std::optional<ExactRun> run = run_exact(scene);
    if (!run || run->events == 0) continue;
    ++runs;
    events += run->events;
    const std::string where = "seed " + std::to_string(seed) +
                              ", t = " + std::to_string(run->first.t) + ": " +
                              name(run->first.suspicion);
    EXPECT_EQ(run->both, 0) << where;
    EXPECT_EQ(run->timing, 0) << where;
  }
  EXPECT_GT(events, 10 * runs);
}

std::string name_of(const testing::TestParamInfo<MachineKind>& kind) {
  constexpr std::array names = {"Any", "Balls", "Chains", "Beams"};
  return names.at(static_cast<std::size_t>(kind.param));
}

INSTANTIATE_TEST_SUITE_P(Kinds, ExactStart, testing::ValuesIn(machine_kinds), name_of);

}  // namespace
}  // namespace sprag
