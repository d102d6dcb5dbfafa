// What was, against motions that have gone forward from it.
#include "sprag/estimation/retrodiction.h"

#include <gtest/gtest.h>

#include "tests/support/random_model.h"

namespace sprag {
namespace {

TEST(Retrodiction, IsWhereTheMotionCameFrom) {
  constexpr std::uint64_t seed = 8101;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  for (int trial = 0; trial < 300; ++trial) {
    const ImpactingMachine machine = random_impacting_machine(random);
    const Flows flows(machine.model);
    const Flow& flow = flows[0];
    const Eigen::Index f = flows.dynamics().coordinates();
    const Instant t0 = at(random.uniform(0.0, 10.0));
    constexpr Eigen::Index columns = 3;
    const auto enter = [&](const Eigen::VectorXd& q, const Eigen::VectorXd& u, Instant t) {
      Motion motion;
      flow.enter(q, u, t, Eigen::VectorXd(), motion);
      return motion;
    };
    const auto state = [&](const Motion& motion) {
      Eigen::VectorXd x(2 * f);
      flow.state(motion, x.head(f), x.tail(f));
      return x;
    };
    const Eigen::MatrixXd S = 0.3 * random.matrix(2 * f, columns);
    const Motion mean_then = enter(machine.start.q, machine.start.u, t0);
    Retrodiction retrodiction(flows, columns);

    // As far as rounding does not grow beyond all bounds on the way back.
    double age = random.uniform(0.01, 0.5);
    Belief belief{machine.start.q, machine.start.u, S.topRows(f), S.bottomRows(f), columns};
    const Signal& gap = flow.gap(0);
    retrodiction.begin(gap, mean_then, belief);
    while (!retrodiction.reaches(-4.0 * age)) age *= 0.5;

    Motion mean_now;
    flow.propagate(mean_then, t0 + age, mean_now);
    std::vector<Motion> then, now;
    for (Eigen::Index j = 0; j < columns; ++j) {
      then.push_back(
          enter(machine.start.q + S.col(j).head(f), machine.start.u + S.col(j).tail(f), t0));
      now.emplace_back();
      flow.propagate(then.back(), t0 + age, now.back());
      const Eigen::VectorXd difference = state(now.back()) - state(mean_now);
      belief.S_q.col(j) = difference.head(f);
      belief.S_u.col(j) = difference.tail(f);
    }
    retrodiction.begin(gap, mean_now, belief);

    const double scale = 1.0 + state(mean_then).norm() + state(mean_now).norm() +
                         mean_then.x.z.matrix().norm() + mean_then.x.v.matrix().norm();
    const double rounding = 1e-11 * scale;
    retrodiction.go_back(age);
    EXPECT_NEAR(retrodiction.value(), value(gap, mean_then), rounding) << trial;
    EXPECT_NEAR(retrodiction.rate(), rate(gap, mean_then), rounding) << trial;
    EXPECT_LT((state(retrodiction.mean()) - state(mean_then)).norm(), rounding) << trial;
    for (Eigen::Index j = 0; j < columns; ++j) {
      const Motion& of = then[static_cast<std::size_t>(j)];
      EXPECT_NEAR(retrodiction.phi()[j], value(gap, of) - value(gap, mean_then), rounding) << trial;
      EXPECT_NEAR(retrodiction.psi()[j], rate(gap, of) - rate(gap, mean_then), rounding) << trial;
    }
    const Eigen::VectorXd xi = Eigen::VectorXd::Unit(columns, 1);
    retrodiction.set_xi(xi);
    EXPECT_LT((state(retrodiction.mean()) - state(then[1])).norm(), rounding) << trial;
    retrodiction.return_to_motion();
    EXPECT_LT((state(retrodiction.mean()) - state(now[1])).norm(), rounding) << trial;
  }
}

// What has decayed to nothing is not made to grow back.
TEST(Retrodiction, IsBoundedWhereAModeHasDecayedLongAgo) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Constant(1, 1, 200.0);
  model.K = Eigen::MatrixXd::Constant(1, 1, 20000.0);
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.1, {}, 0.5});
  const Flows flows(model);
  const Belief belief{Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Zero(1),
                      Eigen::MatrixXd::Identity(1, 2), Eigen::MatrixXd::Zero(1, 2), 2};
  Motion motion;
  flows[0].enter(belief.q, belief.u, at(100.0), Eigen::VectorXd(), motion);
  Retrodiction retrodiction(flows, 2);
  retrodiction.begin(flows[0].gap(0), motion, belief);
  EXPECT_TRUE(retrodiction.reaches(-0.1));
  EXPECT_FALSE(retrodiction.reaches(-1.0));
  retrodiction.go_back(10.0);
  EXPECT_LT(std::abs(retrodiction.value()), 1e7);
  EXPECT_LT(retrodiction.phi().norm(), 1e7);
}

}  // namespace
}  // namespace sprag
