// Would catch a flow that does not satisfy the equation of motion, near resonance, under weight, or
// with floating parts.
#include "sprag/detail/mechanics/flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/reference_motion.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

std::vector<int> members(ContactSet set) {
  std::vector<int> list;
  for (; set != 0; set &= set - 1) list.push_back(std::countr_zero(set));
  return list;
}

// g and gamma at q and u, in extended precision: at t = 50 the rounding of a support's phase Omega
// t in double contributes 1e-13, as much as the tested error.
double exact_gap(const Contact& contact, const Eigen::VectorXd& q, long double t) {
  const Harmonic& s = contact.motion;
  return static_cast<double>(contact.w.cast<long double>().dot(q.cast<long double>()) +
                             s.amplitude * std::cos(s.frequency * t + s.phase) + contact.clearance);
}
double exact_gap_velocity(const Contact& contact, const Eigen::VectorXd& u, long double t) {
  const Harmonic& s = contact.motion;
  return static_cast<double>(contact.w.cast<long double>().dot(u.cast<long double>()) -
                             s.amplitude * s.frequency * std::sin(s.frequency * t + s.phase));
}

// Gives the locked contacts gamma = 0 by the smallest impulse.
void stop_contacts(const Model& model, const std::vector<int>& locked, double t, State& state) {
  const auto l = static_cast<Eigen::Index>(locked.size());
  if (l == 0) return;
  Eigen::MatrixXd W(model.coordinates(), l);
  for (int repeat = 0; repeat < 3; ++repeat) {  // to rounding accuracy
    Eigen::VectorXd gamma(l);
    for (Eigen::Index i = 0; i < l; ++i) {
      const Contact& contact =
          model.contacts[static_cast<std::size_t>(locked[static_cast<std::size_t>(i)])];
      W.col(i) = contact.w;
      gamma[i] = exact_gap_velocity(contact, state.u, t);
    }
    const Eigen::MatrixXd MinvW = CholeskyFactor(model.M).solve(W);
    const Eigen::MatrixXd G = product(W.transpose(), MinvW);
    state.u -= product(MinvW, CholeskyFactor(G).solve(gamma));
  }
}

Eigen::VectorXd gaps(const Model& model, const std::vector<int>& contacts, const State& state,
                     double t) {
  Eigen::VectorXd g(static_cast<Eigen::Index>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    g[static_cast<Eigen::Index>(i)] =
        exact_gap(model.contacts[static_cast<std::size_t>(contacts[i])], state.q, t);
  }
  return g;
}

Eigen::VectorXd as_double(const ReferenceMotion::Vector& x) { return x.cast<double>(); }

class FlowOfAStructure : public testing::TestWithParam<std::size_t> {};

std::string structure_name(const testing::TestParamInfo<std::size_t>& structure) {
  return structure_names[structure.param];
}

// A double eigenvalue without a second eigenvector has half the digits of the extended precision in
// which a flow's modes are computed.
constexpr double defective = 1e-10;

// All properties of a flow, compared with an independent integration.
void check_flow(const Model& model, ContactSet set, double t0, State start,
                double tolerance = 1e-12) {
  const Dynamics dynamics(model);
  const Flow flow(dynamics, set);
  const std::vector<int> locked = members(set);
  stop_contacts(model, locked, t0, start);
  const Eigen::VectorXd held = gaps(model, locked, start, t0);

  Motion entered;
  flow.enter(start.q, start.u, at(t0), held, entered);
  State here{Eigen::VectorXd(model.coordinates()), Eigen::VectorXd(model.coordinates())};
  flow.state(entered, here.q, here.u);
  EXPECT_LT((here.q - start.q).norm(), 0.1 * tolerance * (1 + start.q.norm()))
      << "enter, then state: q";
  EXPECT_LT((here.u - start.u).norm(), 0.1 * tolerance * (1 + start.u.norm()))
      << "enter, then state: u";

  ReferenceMotion reference(model, locked, start, t0);
  double before = 0.0;
  for (const double tau : {0.01, 0.3, 1.0, 4.0}) {
    reference.advance(static_cast<long double>(tau) - before);
    before = tau;
    Motion moved;
    flow.propagate(entered, at(t0) + tau, moved);
    flow.state(moved, here.q, here.u);
    const long double t = static_cast<long double>(t0) + tau;
    const double size = 1 + as_double(reference.q()).norm() + as_double(reference.u()).norm();
    EXPECT_LT((here.q - as_double(reference.q())).norm(), tolerance * size) << "q after " << tau;
    EXPECT_LT((here.u - as_double(reference.u())).norm(), tolerance * size) << "u after " << tau;

    const double force_size = (model.K.norm() + model.C.norm() + 10.0) * size;
    const ReferenceMotion::Vector lambda = reference.lambda();
    for (std::size_t i = 0; i < locked.size(); ++i) {
      const int contact = locked[i];
      const Contact& c = model.contacts[static_cast<std::size_t>(contact)];
      EXPECT_NEAR(exact_gap_velocity(c, here.u, t), 0.0, 0.1 * tolerance * size)
          << "gamma of " << contact;
      EXPECT_NEAR(exact_gap(c, here.q, t), held[static_cast<Eigen::Index>(i)],
                  0.1 * tolerance * size)
          << "g of " << contact;
      EXPECT_NEAR(value(flow.force(contact), moved),
                  static_cast<double>(lambda[static_cast<Eigen::Index>(i)]), tolerance * force_size)
          << "force of " << contact << " after " << tau;
    }
    for (int i = 0; i < dynamics.contacts(); ++i) {
      if (contains(set, i)) continue;
      const Contact& c = model.contacts[static_cast<std::size_t>(i)];
      EXPECT_NEAR(value(flow.gap(i), moved), exact_gap(c, here.q, t), 0.1 * tolerance * size)
          << "gap of " << i;
      const double gamma = exact_gap_velocity(c, here.u, t);
      EXPECT_NEAR(value(flow.gap_velocity(i), moved), gamma, tolerance * size)
          << "velocity of " << i;
      EXPECT_NEAR(rate(flow.gap(i), moved), gamma, tolerance * size) << "rate of the gap of " << i;
    }
  }
}

// L = {}, {i} and {i, j}, as far as the number of coordinates allows.
TEST_P(FlowOfAStructure, SatisfiesEquationOfMotion) {
  const Structure structure = structures[GetParam()];
  for (int i = 0; i < repetitions(40); ++i) {
    const std::uint64_t seed = 1000 * (GetParam() + 1) + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Eigen::Index f = random.integer(1, 5);
    Model model = random_machine(random, structure, f);
    add_forces(random, model, random.integer(0, 2));
    add_contacts(random, model, 3);
    const State start = random_state(random, model);
    const double t0 = random.chance(0.5) ? 0.0 : random.uniform(0, 50);
    for (const ContactSet set : {ContactSet{0}, bit(1), bit(0) | bit(2)}) {
      if (std::popcount(set) > f) continue;
      SCOPED_TRACE(testing::Message() << "f = " << f << ", locked set " << set);
      try {
        check_flow(model, set, t0, start);
      } catch (const ModelError& error) {
        ADD_FAILURE() << "refused: " << error.what();
      }
    }
    if (HasFailure()) return;
  }
}

// Springs and dampers so soft that the static equilibrium is up to 1e15 away. Not with coupled C:
// complex modes distinguish two positions and two velocities only by their slow decays.
TEST_P(FlowOfAStructure, IsAccurateOnSoftSpringsUnderWeight) {
  const Structure structure = structures[GetParam()];
  for (int i = 0; i < repetitions(40); ++i) {
    const std::uint64_t seed = 20000 + 1000 * GetParam() + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Eigen::Index f = random.integer(1, 5);
    Model model = random_machine(random, structure, f);
    const double soft = random.log_uniform(1e-14, 1e-4);
    model.K *= soft;
    model.C *= random.chance(0.5) ? std::sqrt(soft) : random.log_uniform(1e-8, 1.0);
    model.forces.push_back({random.vector(f), -9.81, {}});
    add_contacts(random, model, 3);
    for (Contact& contact : model.contacts) contact.motion.amplitude = 0.0;
    const State start = random_state(random, model);
    for (const ContactSet set : {ContactSet{0}, bit(1), bit(0) | bit(2)}) {
      if (std::popcount(set) > f) continue;
      if (Flow(Dynamics(model), set).path() == FlowPath::dense) continue;
      SCOPED_TRACE(testing::Message() << "f = " << f << ", locked set " << set << ", K * " << soft);
      check_flow(model, set, 0.0, start);
    }
    if (HasFailure()) return;
  }
}

// Driven at or near the frequency of one of its modes, with its own or almost no damping.
TEST_P(FlowOfAStructure, IsAccurateAtAndNearResonance) {
  const Structure structure = structures[GetParam()];
  for (int i = 0; i < repetitions(40); ++i) {
    const std::uint64_t seed = 40000 + 1000 * GetParam() + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Eigen::Index f = random.integer(1, 5);
    Model model = random_machine(random, structure, f);
    if (model.K.isZero()) return;
    model.C *= random.chance(0.3) ? 0.0 : random.log_uniform(1e-12, 1e-2);
    add_contacts(random, model, 3);
    const State start = random_state(random, model);
    for (const ContactSet set : {ContactSet{0}, bit(1), bit(0) | bit(2)}) {
      if (std::popcount(set) >= f) continue;
      const Flow without(Dynamics(model), set);
      const double w = without.oscillators().root_kappa()[without.frequencies()];
      const double off = random.chance(0.3) ? 0.0 : random.log_uniform(1e-13, 1e-2);
      model.forces = {{random.vector(f), 0.0, {1.0, w * (1.0 + off), random.phase()}}};
      SCOPED_TRACE(testing::Message()
                   << "f = " << f << ", locked set " << set << ", off by " << off);
      if (without.oscillators().delta()[without.frequencies()] < w / 64.0) {
        EXPECT_FALSE(Flow(Dynamics(model), set).drives().empty());
      }
      check_flow(model, set, random.uniform(0.0, 50.0), start, 1e-11);
    }
    if (HasFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(All, FlowOfAStructure, testing::Range<std::size_t>(0, structures.size()),
                         structure_name);

TEST(Flow, SelectsCheapestExactPath) {
  const std::uint64_t seed = 41;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  const auto path = [&](Structure structure, ContactSet locked) {
    Model model = random_machine(random, structure, 4);
    add_contacts(random, model, 2);
    const Dynamics dynamics(model);
    return Flow(dynamics, locked).path();
  };
  EXPECT_EQ(path(Structure::diagonal, 0), FlowPath::diagonal);
  EXPECT_EQ(path(Structure::simultaneous, 0), FlowPath::modal);
  EXPECT_EQ(path(Structure::repeated, 0), FlowPath::modal);
  EXPECT_EQ(path(Structure::all_equal, 0), FlowPath::modal);
  EXPECT_EQ(path(Structure::no_stiffness, 0), FlowPath::modal);
  EXPECT_EQ(path(Structure::coupled, 0), FlowPath::dense);
  EXPECT_EQ(path(Structure::repeated_pair, 0), FlowPath::dense);
  EXPECT_EQ(path(Structure::rayleigh, 1), FlowPath::modal);
  EXPECT_EQ(path(Structure::all_equal, 3), FlowPath::modal);
  EXPECT_EQ(path(Structure::coupled, 1), FlowPath::dense);
}

// In the middle of a long run, where the rounded product Omega t has an error of 1e-13.
TEST(Flow, ExcitationPhaseIsAccurateLate) {
  Model model;
  model.M = model.K = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Constant(1, 1, 0.5);
  model.forces.push_back({Eigen::VectorXd::Ones(1), 0.0, {1.0, 9.7, 0.0}});
  const Dynamics dynamics(model);
  const Flow flow(dynamics, 0);
  OscillatorState x{Eigen::ArrayXd::Zero(2), Eigen::ArrayXd::Zero(2)};
  for (const std::int64_t k : {1L, 4000L, 123457L, 40000001L}) {
    const Instant t = tick_instant(k, 0.01);
    flow.set_phases(t, x);
    // In 80 bits the product of 9.7 and the instant has an error of 1e-14 there.
    const long double phase = 9.7 * (static_cast<long double>(t.hi) + t.lo);
    EXPECT_NEAR(x.z[0], static_cast<double>(std::cos(phase)), 2e-15 + 1e-19 * std::abs(t.hi) * 10);
    EXPECT_NEAR(x.v[0], static_cast<double>(-9.7L * std::sin(phase)),
                2e-14 + 1e-18 * std::abs(t.hi) * 10);
  }
}

TEST(Flow, KicksChangeVelocityByImpulse) {
  for (const Structure structure :
       {Structure::diagonal, Structure::simultaneous, Structure::no_stiffness}) {
    const std::uint64_t seed = 61 + static_cast<std::uint64_t>(structure);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    Model model = random_machine(random, structure, 4);
    add_forces(random, model, 1);
    add_contacts(random, model, 2);
    const Dynamics dynamics(model);
    const Flow flow(dynamics, 0);
    ASSERT_TRUE(flow.accepts_kicks());
    const State start = random_state(random, model);
    Motion motion;
    flow.enter(start.q, start.u, at(0.7), Eigen::VectorXd(0), motion);
    flow.kick(1, 0.31, motion);
    State after = start;
    flow.state(motion, after.q, after.u);
    const Eigen::VectorXd expected =
        start.u + 0.31 * CholeskyFactor(model.M).solve(model.contacts[1].w);
    EXPECT_LT((after.q - start.q).norm(), 1e-13);
    EXPECT_LT((after.u - expected).norm(), 1e-13);
  }
}

TEST(Flow, DependentLockedDirectionsAreRefused) {
  const std::uint64_t seed = 71;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  Model model = random_machine(random, Structure::diagonal, 3);
  add_contacts(random, model, 2);
  Contact sum = model.contacts[0];
  sum.w = 0.3 * model.contacts[0].w - 2.0 * model.contacts[1].w;
  Contact twin = model.contacts[0];
  twin.w *= -5.0;
  model.contacts.push_back(sum);
  model.contacts.push_back(twin);
  const Dynamics dynamics(model);
  EXPECT_NO_THROW(Flow(dynamics, bit(0) | bit(1)));
  EXPECT_NO_THROW(Flow(dynamics, bit(1) | bit(2)));
  EXPECT_THROW(Flow(dynamics, bit(0) | bit(3)), ModelError);
  EXPECT_THROW(Flow(dynamics, bit(0) | bit(1) | bit(2)), ModelError);
  // More contacts than coordinates.
  EXPECT_THROW(Flow(dynamics, bit(0) | bit(1) | bit(2) | bit(3)), ModelError);
}

TEST(Flow, MassThatIsNotPositiveDefiniteIsRefused) {
  Model model;
  model.M = Eigen::Vector2d(1.0, 0.0).asDiagonal();
  model.C = model.K = Eigen::Matrix2d::Identity();
  EXPECT_THROW(Dynamics{model}, ModelError);
  model.M = (Eigen::Matrix2d() << 1, 2, 2, 1).finished();
  EXPECT_THROW(Dynamics{model}, ModelError);
}

// Machines with a rigid-body mode: k = 0 is an ordinary case on the dense path as well.
TEST(Flow, AFloatingChainWithOneInnerDamperDrifts) {
  Model model;
  model.M = Eigen::Matrix3d::Identity();
  model.K = (Eigen::Matrix3d() << 3, -3, 0, -3, 5, -2, 0, -2, 2).finished();
  model.C = (Eigen::Matrix3d() << 0.4, -0.4, 0, -0.4, 0.4, 0, 0, 0, 0).finished();
  check_flow(model, 0, 0.0, {Eigen::Vector3d(0.1, 0.2, 0.0), Eigen::Vector3d(0.5, -0.3, 0.2)},
             defective);
}

// C couples the modes of K, and s = -1 is a double root of (s^2 + s + 1/2) (s^2 + 2 s + 3/2) - s^2
// / 4: critical damping without an eigenvector of its own.
TEST(Flow, CriticalDampingOfCoupledModeIsSupported) {
  for (const double off : {0.0, 1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3}) {
    SCOPED_TRACE(testing::Message() << "off the double root by " << off);
    Model model;
    model.M = Eigen::Matrix2d::Identity();
    model.K = Eigen::Vector2d(0.5, 1.5).asDiagonal();
    model.C = (Eigen::Matrix2d() << 1.0 + off, 0.5, 0.5, 2.0).finished();
    try {
      check_flow(model, 0, 0.0, {Eigen::Vector2d(0.1, 0.2), Eigen::Vector2d(0.5, -0.3)}, defective);
    } catch (const ModelError& error) {
      ADD_FAILURE() << "refused: " << error.what();
    }
  }
}

// det(s^2 + C s + K) = (s^2 + 0.2 s + 1)^2, with one complex eigenvector for both factors: the
// motion contains t e^(st), which oscillators do not represent.
TEST(Flow, DefectiveComplexPairIsRefusedAndNeighboursAreNot) {
  Model model;
  model.M = Eigen::Matrix2d::Identity();
  model.K = (Eigen::Matrix2d() << 1.04, 0.2, 0.2, 1.0).finished();
  model.C = Eigen::Vector2d(0.4, 0.0).asDiagonal();
  EXPECT_THROW(Flow(Dynamics(model), 0), ModelError);
  for (const double off : {1e-2, -1e-2, 1e-4}) {
    SCOPED_TRACE(testing::Message() << "off by " << off);
    model.C(1, 1) = std::max(off, 0.0);
    model.C(0, 0) = 0.4 + off;
    check_flow(model, 0, 0.0, {Eigen::Vector2d(0.1, 0.2), Eigen::Vector2d(0.5, -0.3)}, 1e-11);
  }
}

// Two rigid-body modes, damped and coupled by dampers to the ground from weak to strong; a weight
// on each mass.
TEST(Flow, AFloatingPairInThePlaneFalls) {
  for (const double c : {1e-4, 0.01, 0.5, 5.0, 50.0}) {
    SCOPED_TRACE(testing::Message() << "c = " << c);
    const Eigen::Vector4d stretch(1.0, 0.5, -1.0, -0.5);
    const Eigen::Vector4d bend(0.3, 1.0, -0.3, -1.0);
    const Eigen::Vector4d first(1.0, 0.2, 0.0, 0.0);
    const Eigen::Vector4d second(0.1, 1.0, 0.0, 0.4);
    Model model;
    model.M = Eigen::Matrix4d::Identity();
    model.K = 30.0 * stretch * stretch.transpose() + 5.0 * bend * bend.transpose();
    model.C = c * first * first.transpose();
    model.forces.push_back({Eigen::Vector4d(0.0, 1.0, 0.0, 1.0), -9.81, {}});
    const State start{Eigen::Vector4d(0.1, 0.2, -0.3, 0.4), Eigen::Vector4d(0.5, -0.3, 0.2, 0.1)};
    check_flow(model, 0, 0.0, start);
    model.C += 0.3 * c * second * second.transpose();
    model.contacts.push_back({Eigen::Vector4d(0.0, 1.0, 0.0, 0.0), 0.3, {0.1, 2.0, 0.0}, 0.5});
    check_flow(model, 0, 0.0, start);
    check_flow(model, 1, 0.0, start);
  }
}

// A state inconsistent with the locked contacts is corrected by the static deflection that closes
// their gaps. It is orthogonal, with respect to K, to all motions that keep them closed.
TEST_P(FlowOfAStructure, ClosesGapsStatically) {
  for (int i = 0; i < repetitions(20); ++i) {
    const std::uint64_t seed = 60000 + 1000 * GetParam() + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const int f = random.integer(1, 5);
    Model model = random_machine(random, structures[GetParam()], f);
    const int m = random.integer(1, std::min(f, 3));
    add_contacts(random, model, m);
    const Dynamics dynamics(model);
    const ContactSet all = bit(m) - 1;
    const Flow flow(dynamics, all);
    const State state = random_state(random, model);
    const double t = random.uniform(0, 10);
    Eigen::VectorXd q = state.q;
    flow.close_gaps(flow.locked(), at(t), q);
    for (const Contact& contact : model.contacts) {
      EXPECT_NEAR(exact_gap(contact, q, t), 0.0, 1e-12 * (1 + state.q.norm()));
    }
    const Eigen::VectorXd moved = q - state.q;
    const Eigen::MatrixXd Q = QR(dynamics.W()).Q_times(Eigen::MatrixXd::Identity(f, f));
    const Eigen::MatrixXd kept = Q.rightCols(f - m);
    if (f > m) {
      EXPECT_LE((kept.transpose() * (model.K * moved)).norm(),
                1e-10 * kept.norm() * model.K.norm() * (1 + moved.norm()));
    }
    Eigen::MatrixXd differences(f, 2);
    differences << state.q, q;
    flow.close_gap_differences(differences);
    EXPECT_LT((dynamics.W().transpose() * differences).norm(), 1e-12 * (1 + state.q.norm()));
    const auto energy = [&](const auto& x) { return x.dot(model.K * x); };
    EXPECT_LE(energy(differences.col(0)), energy(state.q) * (1 + 1e-12));
  }
}

}  // namespace
}  // namespace sprag
