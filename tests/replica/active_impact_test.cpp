// The impact of one contact while others are closed: which of them stay closed.
#include "sprag/detail/replica/active_impact.h"

#include <gtest/gtest.h>

#include <bit>

#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {
namespace {

// Two masses, each over its own support, coupled by M only: G = M^-1.
Model two_masses(double coupling, ImpactLaw law, double epsilon) {
  Model model;
  model.M = Eigen::Matrix2d{{1.0, coupling}, {coupling, 2.0}};
  model.C = model.K = Eigen::Matrix2d::Identity();
  model.law = law;
  for (int i = 0; i < 2; ++i) {
    Contact contact;
    contact.w = Eigen::Vector2d::Unit(i);
    contact.restitution = epsilon;
    model.contacts.push_back(contact);
  }
  return model;
}

TEST(SingleImpact, OfOneContactFollowsItsRestitution) {
  const Dynamics dynamics(two_masses(0.3, ImpactLaw::poisson, 0.7));
  const SingleImpact impact =
      single_impact(dynamics.G(), ImpactLaw::poisson, Eigen::Vector2d::Constant(0.7), 1, 0.7, 0);
  ASSERT_EQ(impact.solved, Solved::yes);
  EXPECT_EQ(impact.staying, 0U);
  EXPECT_DOUBLE_EQ(impact.change, 1.7);
  EXPECT_DOUBLE_EQ(impact.Lambda[0], 1.0 / dynamics.G()(1, 1));
}

TEST(SingleImpact, ForcesReleaseOfHeldContacts) {
  struct Case {
    double coupling;  // negative: the struck mass pulls the other one along
    ImpactLaw law;
    double epsilon;  // of the closed contact
    bool stays;
  };
  for (const Case& of :
       {Case{-0.3, ImpactLaw::poisson, 0.5, false}, Case{-0.3, ImpactLaw::newton, 0.5, false},
        Case{0.3, ImpactLaw::newton, 0.5, true},
        // By Poisson's law the closed contact's expansion returns a share of its impulse. With its
        // own smaller restitution this is too little against the impulse of the other contact, and
        // it stays closed.
        Case{0.3, ImpactLaw::poisson, 0.9, false}, Case{0.3, ImpactLaw::poisson, 0.5, true},
        Case{0.0, ImpactLaw::poisson, 0.5, true}}) {
    const Dynamics dynamics(two_masses(of.coupling, of.law, of.epsilon));
    const SingleImpact impact =
        single_impact(dynamics.G(), of.law, Eigen::Vector2d::Constant(of.epsilon), 0, 0.8, bit(1));
    ASSERT_EQ(impact.solved, Solved::yes);
    EXPECT_EQ(contains(impact.staying, 1), of.stays) << of.coupling;
    // The changes are those of the impulses, which are nonnegative.
    const Eigen::Vector2d change = dynamics.G() * impact.Lambda;
    EXPECT_NEAR(change[0], 1.0, 1e-15);
    EXPECT_GE(change[1], -1e-15);
    EXPECT_GE(impact.Lambda.minCoeff(), 0.0);
    EXPECT_EQ(of.stays, std::abs(change[1]) < 1e-15) << of.coupling;
    if (of.law == ImpactLaw::newton) {
      EXPECT_NEAR(impact.change, 1.8, 1e-15);
    }
  }
}

}  // namespace
}  // namespace sprag
