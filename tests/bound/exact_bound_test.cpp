// The terms of the bound B of exact machines with exact events: the contraction by a flight, and
// what joint impacts add.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "sprag/detail/bound/flight_contraction.h"
#include "sprag/detail/bound/impact_remainder.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "tests/support/flight_norm.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag::test {
namespace {

/// Free motion of a machine at rest.
Motion at_rest(const Flows& flows, double t) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(flows.dynamics().coordinates());
  Motion motion;
  flows[0].enter(zero, zero, at(t), Eigen::VectorXd(), motion);
  return motion;
}

// The table is never too small, and never grows with the duration.
TEST(FlightContraction, TableDecreases) {
  for (const char* scene : {"paper_beam", "non_proportional"}) {
    const Flows flows(shipped_scene(scene).model);
    FlightContraction flight(flows);
    double before = 1.0;
    for (double tau = 0.0; tau < 200.0; tau += 0.01) {
      const double square = flight.square_at_node(tau);
      ASSERT_LE(square, before + 1e-13) << scene << ", tau = " << tau;
      ASSERT_GE(square, flight.square(tau) - 1e-13) << scene << ", tau = " << tau;
      before = square;
    }
    EXPECT_LT(before, 1e-12) << scene;
  }
}

TEST(FlightContraction, EqualsLargestSingularValueOfFlow) {
  constexpr std::uint64_t seed = 61;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double loosest = 1.0;
  for (const Structure structure : structures) {
    for (int repetition = 0; repetition < repetitions(40); ++repetition) {
      Model model = random_machine(random, structure, random.integer(1, 5));
      const Eigen::Index f = model.coordinates();
      if (f > 1 && random.chance(0.3)) {  // a rigid-body mode
        const Eigen::VectorXd w = random.vector(f);
        const Eigen::VectorXd Kw = model.K * w;
        if (w.dot(Kw) > 0.0) model.K -= Kw * Kw.transpose() / w.dot(Kw);
        model.K = (0.5 * (model.K + model.K.transpose())).eval();
      }
      model.contacts.push_back({Eigen::VectorXd::Ones(f), 0.0, {}, 0.5});
      const Flows flows(model);
      FlightContraction flight(flows);
      const FlightNorm norm(flows);
      const double tau = random.log_uniform(1e-3, 10.0);
      const double contraction = flight.square(tau);
      if (flows[0].path() == FlowPath::dense) {
        EXPECT_GE(contraction, norm.square(tau) - 1e-10);
        EXPECT_LE(contraction, norm.square(0.94 * tau) + 1e-5);
        loosest = std::max(loosest, contraction / norm.square(tau));
      } else {
        EXPECT_NEAR(contraction, norm.square(tau), 1e-9)
            << "structure " << static_cast<int>(structure) << " tau " << tau;
      }
    }
  }
  std::cout << "of dense machines at most " << loosest << " times sigma^2\n";
}

// A contact that closes and stays closed, together with others that bounce, can increase the
// distance of two machines. The bound's additional term covers this, and is not larger than a
// multiple of the distance.
TEST(ImpactRemainder, CoversMixedSustainedAndPulseImpacts) {
  constexpr std::uint64_t seed = 62;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  double largest = 0.0;
  double most_added = 0.0;
  int expanding = 0;
  int pairs = 0;
  for (int number = 0; number < repetitions(400); ++number) {
    const Eigen::Index f = 5;
    Model model = random_machine(random, Structure::coupled, f);
    model.chatter_time = 1e-12;
    const int m = random.integer(2, 4);
    const double restitution = random.uniform(0.1, 1.0);
    const ContactSet all = bit(m) - 1;
    for (int i = 0; i < m; ++i) {
      model.contacts.push_back({random.vector(f), 0.0, {}, restitution});
    }
    const Flows flows(model);
    const Eigen::MatrixXd& G = flows.dynamics().G();
    const Eigen::VectorXd values = eigenvalues(G);
    if (values[0] < 1e-3 * values[m - 1]) continue;
    const CholeskyFactor factor(G);
    const auto solve = [&](const ContactVector& x) -> Eigen::VectorXd { return factor.solve(x); };
    const EnergyMetric metric(flows.dynamics());
    ImpactRemainder remainder(metric);
    const ContactMatrix of_all = of_contacts(G, all);
    for (int pair = 0; pair < 1000; ++pair) {
      // Some contacts were closed before: those of the master rest, those of the replica may open.
      const ContactSet before = random.chance(0.5) ? bit(random.integer(0, m - 1)) : 0;
      ContactVector a(m), E(m), Lambda, a_plus, b_plus;
      ContactSet to_stay = 0;
      for (int i = 0; i < m; ++i) {
        const bool stays = !contains(before, i) && random.chance(0.5);
        if (stays) to_stay |= bit(i);
        E[i] = stays ? 0.0 : restitution;
        a[i] = contains(before, i) ? 0.0 : random.uniform(-1, random.chance(0.3) ? 1 : 0);
      }
      ASSERT_EQ(impact(ImpactLaw::poisson, of_all, E, a, Lambda, a_plus), Solved::yes);
      ContactSet chi = 0;
      for_each(all, [&](int i) {
        if (a_plus[i] < 1e-14 && (contains(before | to_stay, i))) chi |= bit(i);
      });
      if (to_stay == 0 || (to_stay & ~chi) != 0) continue;  // a master does not do this
      const double apart = random.chance(0.5) ? 1.0 : random.log_uniform(1e-6, 1e-1);
      Eigen::VectorXd gamma = a;
      for (int i = 0; i < m; ++i) {
        gamma[i] += apart * random.uniform(-1, 1);
        if (contains(before, i)) gamma[i] = std::max(gamma[i], 0.0);
      }
      Motion motion = at_rest(flows, 0.0);
      ModalState state;
      metric.enter(Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f), state);
      remainder.start(motion, state, 0);
      flows[0].enter(Eigen::VectorXd::Zero(f), flows.dynamics().MinvW() * solve(gamma), at(1.0),
                     Eigen::VectorXd(), motion);
      metric.enter(Eigen::VectorXd::Zero(f), flows.dynamics().MinvW() * solve(gamma), state);
      const double added = remainder.of(
          {.before = before, .closing = all & ~before, .staying = to_stay, .after = chi}, motion,
          state);
      const ContactVector b = gamma;
      ASSERT_EQ(impact(ImpactLaw::poisson, of_all, E, b, Lambda, b_plus), Solved::yes);
      const auto distance = [&](const Eigen::VectorXd& x) {
        return std::sqrt(0.5 * x.dot(solve(x)));
      };
      const double distance_before = distance(a - b);
      const double distance_after = distance(a_plus - b_plus);
      ++pairs;
      largest = std::max(largest, distance_after / distance_before);
      most_added = std::max(most_added, added / distance_before);
      if (distance_after > distance_before * (1.0 + 1e-9)) ++expanding;
      ASSERT_LE(distance_after, distance_before * (1.0 + 1e-12) + added + 1e-13);
      ASSERT_LE(added, 3.0 * distance_before + 1e-8);
    }
  }
  std::cout << pairs << " pairs, largest growth of the distance " << largest << ", " << expanding
            << " impacts expand; added at most " << most_added << " times the distance\n";
  EXPECT_GT(pairs, repetitions(10000));
  EXPECT_GT(expanding, 0);
}

}  // namespace
}  // namespace sprag::test
