// The bound B on the error energy V: it holds at every tick, and it is not void.
#include "mechanics/error_bound.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <iostream>

#include "mechanics/impact_law.h"
#include "mechanics/replica.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

struct Case {
  const char* scene;
  double T;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.scene; }

class BoundOfScene : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(
    Scenes, BoundOfScene,
    testing::Values(Case{"paper_beam", 500.0}, Case{"paper_beam_frame", 50.0},
                    Case{"paper_beam_chatter", 50.0}, Case{"paper_beam_as_printed", 50.0},
                    Case{"stiff_beam", 5.0}, Case{"two_stops_beam", 50.0},
                    Case{"two_supports_beam", 50.0}, Case{"non_proportional", 50.0},
                    Case{"steel_ruler", 2.0}, Case{"lab_rig", 20.0}, Case{"elastic_bar", 50.0},
                    Case{"bouncing_ball", 10.0}, Case{"impact_oscillator", 100.0},
                    Case{"three_ball_chain", 2.0}),
    [](const auto& parameter) { return std::string(parameter.param.scene); });

TEST_P(BoundOfScene, HoldsAtEveryTick) {
  Pair<Replica> pair(shipped_scene(GetParam().scene), 1e-2);
  // The ball's V does not contain q and is zero at the start.
  const double V0 = std::max(pair.V(), 1e-12);
  double worst = 0.0;
  while (pair.t() < GetParam().T) {
    pair.step();
    const double B = pair.stepper.error_bound(pair.state, V0);
    worst = std::max(worst, pair.V() / B);
    ASSERT_LE(pair.V(), B) << "t = " << pair.t();
  }
  std::cout << GetParam().scene << ": largest V/B " << worst << ", at the end V " << pair.V()
            << ", B/B(0) " << pair.stepper.error_bound(pair.state, V0) / V0 << '\n';
}

// An error that nothing but free flight at its slowest takes away comes close to it.
TEST(ErrorBound, IsNotVoidOnThePapersBeam) {
  Pair<Replica> pair(shipped_scene("paper_beam"), 1e-2);
  double closest = 0.0;
  while (pair.t() < 100.0) {
    pair.step();
    closest = std::max(closest, pair.V() / pair.stepper.error_bound(pair.state, 0.4783534));
  }
  EXPECT_LT(pair.stepper.error_bound(pair.state, 1.0), 1e-4);
  EXPECT_GT(closest, 0.99);
}

TEST(ErrorBound, IsProportionalToTheStartAndKeepsRoundingApart) {
  const ErrorBoundState state{.share = 1e-4, .rounding = 1e-10, .energy = 1.0, .free_since = {}};
  EXPECT_NEAR(state.bound(0.5), 0.5e-4, 1e-11);
  EXPECT_NEAR(state.bound(0.0), 1e-20, 1e-30);
}

// sigma_max of the flow's own matrix, column by column, in the energy norm.
TEST(ErrorBound, ContractionIsTheLargestSingularValueOfTheFlow) {
  constexpr std::uint64_t seed = 61;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  for (const Structure structure :
       {Structure::diagonal, Structure::rayleigh, Structure::simultaneous, Structure::all_equal,
        Structure::coupled}) {
    for (int repetition = 0; repetition < repetitions(40); ++repetition) {
      Model model = random_machine(random, structure, random.integer(1, 5));
      if (model.K.ldlt().vectorD().minCoeff() <= 0.0) continue;
      const Eigen::Index f = model.coordinates();
      model.contacts.push_back({Eigen::VectorXd::Ones(f), 0.0, {}, 0.5});
      const Flows flows(model);
      ErrorBound bound(flows);
      const double tau = random.log_uniform(1e-3, 10.0);
      const Eigen::MatrixXd root_M = model.M.llt().matrixU();
      const Eigen::MatrixXd root_K = model.K.llt().matrixU();
      Eigen::MatrixXd energy = Eigen::MatrixXd::Zero(2 * f, 2 * f);
      energy.topLeftCorner(f, f) = root_K;
      energy.bottomRightCorner(f, f) = root_M;
      Eigen::MatrixXd flow(2 * f, 2 * f);
      Motion from, to;
      Eigen::VectorXd q(f), u(f), q0(f), u0(f);
      const Eigen::VectorXd none;
      for (Eigen::Index j = 0; j < 2 * f; ++j) {
        const Eigen::VectorXd x = Eigen::VectorXd::Unit(2 * f, j);
        flows[0].enter(x.head(f), x.tail(f), at(0.0), none, from);
        flows[0].propagate(from, at(tau), to);
        flows[0].state(to, q, u);
        flow.col(j) << q, u;
      }
      const Eigen::MatrixXd in_energy = energy * flow * energy.inverse();
      const double sigma = in_energy.jacobiSvd().singularValues()[0];
      if (structure == Structure::coupled) {
        EXPECT_GE(bound.contraction(tau), sigma * sigma - 1e-9);
      } else {
        EXPECT_NEAR(bound.contraction(tau), std::min(1.0, sigma * sigma), 1e-9)
            << "structure " << static_cast<int>(structure) << " tau " << tau;
      }
    }
  }
}

// A contact that closes to stay beside others that bounce: the one impact that can expand.
TEST(ErrorBound, GrowthBoundsImpactsOfUnlikeRestitution) {
  constexpr std::uint64_t seed = 62;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double largest = 0.0;
  int expanding = 0;
  for (int machine = 0; machine < repetitions(400); ++machine) {
    const Eigen::Index f = 4;
    Model model = random_machine(random, Structure::coupled, f);
    const int m = random.integer(2, 3);
    const double restitution = random.uniform(0.1, 1.0);
    std::vector<double> epsilon;
    for (int i = 0; i < m; ++i) {
      Eigen::VectorXd w(f);
      for (double& value : w) value = random.uniform(-1, 1);
      model.contacts.push_back({w, 0.0, {}, restitution});
      epsilon.push_back(i == 0 ? 0.0 : restitution);
    }
    const Flows flows(model);
    const Eigen::MatrixXd& G = flows.dynamics().G();
    const Eigen::LLT<Eigen::MatrixXd> inverse(G);
    if (inverse.rcond() < 1e-4) continue;
    ErrorBound bound(flows);
    ErrorBoundState state;
    Motion motion;
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(f);
    flows[0].enter(zero, zero, at(0.0), Eigen::VectorXd(), motion);
    bound.strike((ContactSet{1} << m) - 1, 0, epsilon, motion, state);
    const ContactMatrix of_all = of_contacts(G, (ContactSet{1} << m) - 1);
    const ContactVector E = Eigen::Map<const Eigen::VectorXd>(epsilon.data(), m);
    for (int pair = 0; pair < 1000; ++pair) {
      ContactVector a(m), b(m), Lambda, a_plus, b_plus;
      for (double& value : a) value = random.uniform(-1, 1);
      // Nearly the same velocities show what each branch of the law does.
      const double apart = random.chance(0.5) ? 1.0 : 1e-3;
      for (Eigen::Index i = 0; i < m; ++i) b[i] = a[i] + apart * random.uniform(-1, 1);
      ASSERT_EQ(impact(ImpactLaw::poisson, of_all, E, a, Lambda, a_plus), Solved::yes);
      ASSERT_EQ(impact(ImpactLaw::poisson, of_all, E, b, Lambda, b_plus), Solved::yes);
      // Of M-norms, what lies beside the contacts' directions stays as it is.
      const Eigen::VectorXd before = a - b;
      const Eigen::VectorXd after = a_plus - b_plus;
      const double ratio = after.dot(inverse.solve(after)) / before.dot(inverse.solve(before));
      largest = std::max(largest, ratio);
      if (ratio > 1.0 + 1e-9) ++expanding;
      EXPECT_LE(ratio, state.share * (1.0 + 1e-9));
    }
  }
  std::cout << "largest growth of V " << largest << ", " << expanding << " impacts expand\n";
  EXPECT_GT(expanding, 0);
}

TEST(ErrorBound, IsGivenWhereTheLawIsMonotoneOnly) {
  const auto guaranteed = [](ImpactLaw law, std::vector<double> restitutions) {
    Model model;
    model.M = model.K = model.C = Eigen::MatrixXd::Identity(3, 3);
    model.law = law;
    for (std::size_t i = 0; i < restitutions.size(); ++i) {
      model.contacts.push_back(
          {Eigen::VectorXd::Unit(3, static_cast<Eigen::Index>(i)), 0.0, {}, restitutions[i]});
    }
    Replica replica(model, 1e-3);
    Replica::State state;
    replica.start({Eigen::VectorXd::Zero(3), Eigen::VectorXd::Zero(3)}, 0, 0, state);
    return std::isfinite(replica.error_bound(state, 1.0));
  };
  EXPECT_TRUE(guaranteed(ImpactLaw::poisson, {0.7}));
  EXPECT_TRUE(guaranteed(ImpactLaw::newton, {0.7}));
  EXPECT_TRUE(guaranteed(ImpactLaw::poisson, {0.7, 0.7, 0.7}));
  EXPECT_FALSE(guaranteed(ImpactLaw::poisson, {0.7, 0.6}));
  EXPECT_FALSE(guaranteed(ImpactLaw::newton, {0.7, 0.7}));
}

}  // namespace
}  // namespace sprag::test
