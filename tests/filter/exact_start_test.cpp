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

// Five pendulums of one frequency that touch; the start of the estimate differs slightly from the
// machine's.
TEST(ExactStarts, TouchingPendulumsAreNeverInconsistent) {
  Scene scene;
  constexpr Eigen::Index n = 5;
  scene.model.M = Eigen::MatrixXd::Identity(n, n);
  scene.model.C = Eigen::MatrixXd::Zero(n, n);
  scene.model.K = 9.81 * scene.model.M;
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    Contact contact;
    contact.w = Eigen::VectorXd::Unit(n, i + 1) - Eigen::VectorXd::Unit(n, i);
    contact.restitution = 0.9;
    scene.model.contacts.push_back(contact);
  }
  scene.truth.start = {-Eigen::VectorXd::Unit(n, 0), Eigen::VectorXd::Zero(n)};
  scene.prior.sigma = State{Eigen::VectorXd::Constant(n, 0.05), Eigen::VectorXd::Constant(n, 0.1)};
  for (const double off : {0.0, 0.01}) {
    scene.prior.start = scene.truth.start;
    scene.prior.start.q += off * Eigen::VectorXd::LinSpaced(n, 1.0, 5.0);
    const std::optional<ExactRun> run = run_exact(scene);
    ASSERT_TRUE(run);
    EXPECT_EQ(run->both, 0) << off;
    EXPECT_EQ(run->timing, 0) << off;
  }
}

}  // namespace
}  // namespace sprag
