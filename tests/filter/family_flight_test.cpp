// Would catch a flight of neighbouring machines that differs from exact flows, and wrong
// derivatives by parameters.
#include "sprag/detail/filter/family_flight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <initializer_list>

#include "sprag/detail/filter/event_filter.h"
#include "sprag/detail/filter/model_flight.h"
#include "sprag/detail/identification/task.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_with.h"
#include "tests/support/by_speed.h"
#include "tests/support/random.h"
#include "tests/support/random_model.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"
#include "tests/support/shaken_by_record.h"

namespace sprag {
namespace {

using test::shipped_scene;

// A name that ends with "@" is of the scene shaken by a record of its excitation.
Scene scene_of(std::string name) {
  if (name.back() != '@') return shipped_scene(name);
  name.pop_back();
  return test::shaken_by_record(shipped_scene(name), 0.02, 21.0);
}

// With the gain of a record, which may set the scale.
std::vector<Parameter> unknowns_of_flight(const Scene& scene) {
  std::vector<Parameter> unknowns = unknowns_to_adapt(scene);
  for (const RecordedInput& record : recorded_inputs(scene)) {
    const std::string gain = record.key + ".gain";
    const auto has = [&](const Parameter& of) { return of.key == gain; };
    if (std::none_of(unknowns.begin(), unknowns.end(), has)) {
      unknowns.push_back(parameter_of(scene, gain));
    }
  }
  return unknowns;
}

class FamilyFlightOfScenes : public testing::TestWithParam<const char*> {};

// Derivatives through an impact, compared with difference quotients of whole flights.
TEST_P(FamilyFlightOfScenes, DerivativesMatchDifferenceQuotients) {
  constexpr std::uint64_t seed = 20261123;
  SCOPED_TRACE(seed);
  Random random(seed);
  const Scene scene = scene_of(GetParam());
  const std::vector<Parameter> unknowns = unknowns_of_flight(scene);
  FamilyFlight flight(scene, unknowns), other(scene, unknowns);
  const Eigen::Index n = flight.n(), P = flight.unknowns();
  Eigen::VectorXd x(2 * n), c(P);
  flight.enter(scene.prior.start.q, scene.prior.start.u, 0.0, x);
  x += 0.1 * x.cwiseAbs().maxCoeff() * random.vector(2 * n);
  c = 0.01 * random.vector(P);
  const double t = 0.3, tau = 0.2, later = 0.1, step = 1e-6;
  // To an impact, and from it to the same instant for all.
  const auto after = [&](FamilyFlight& of, const Eigen::VectorXd& from, const Eigen::VectorXd& with,
                         double delay) {
    of.set(with, true);
    of.fly(from, t, tau + delay, 0);
    of.strike(0, false, 0);
    const Eigen::VectorXd struck = of.x();
    of.fly(struck, t + tau + delay, later - delay, 0);
    return Eigen::VectorXd(of.x());
  };
  const auto difference = [&](const Eigen::VectorXd& dx, const Eigen::VectorXd& dc, double dt) {
    return Eigen::VectorXd((after(other, x + step * dx, c + step * dc, step * dt) -
                            after(other, x - step * dx, c - step * dc, -step * dt)) /
                           (2.0 * step));
  };
  const auto expect_same = [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    EXPECT_LT((a - b).norm(), 1e-5 * b.norm() + 1e-9) << a.transpose() << "\n" << b.transpose();
  };
  const Eigen::VectorXd no_x = Eigen::VectorXd::Zero(2 * n), no_c = Eigen::VectorXd::Zero(P);
  flight.set(c, true);
  flight.fly(x, t, tau, 0);
  flight.strike(0, false, 0);
  const Eigen::VectorXd struck = flight.x(), by_time = flight.by_time();
  const Eigen::MatrixXd by_c = flight.by_unknowns();
  Eigen::VectorXd dx = random.vector(2 * n);
  const Eigen::VectorXd of_x = difference(dx, no_c, 0.0);
  flight.carry(dx);
  flight.carry_through(dx);
  // Continues after the impact.
  flight.fly(struck, t + tau, later, 0);
  const Eigen::MatrixXd by_c_later = flight.by_unknowns();
  flight.carry(dx);
  expect_same(dx, of_x);
  Eigen::VectorXd of_time = by_time;
  flight.carry(of_time);
  expect_same(of_time, difference(no_x, no_c, 1.0));
  for (Eigen::Index k = 0; k < P; ++k) {
    Eigen::VectorXd of_c = by_c.col(k);
    flight.carry(of_c);
    of_c += by_c_later.col(k);
    SCOPED_TRACE(unknowns[static_cast<std::size_t>(k)].key);
    expect_same(of_c, difference(no_x, Eigen::VectorXd::Unit(P, k), 0.0));
  }
}

// The same motion in both flights' coordinates.
struct Both {
  ModelFlight of_model;
  FamilyFlight of_family;

  Both(const Scene& scene, std::vector<Parameter> unknowns)
      : of_model(std::make_shared<Flows>(scene.model)), of_family(scene, std::move(unknowns)) {}

  // (q, u) of each after a flight from a state, or after an impact.
  static Eigen::VectorXd state(Flight& flight, double t) {
    Eigen::VectorXd q(flight.n()), u(flight.n()), x = flight.x(), both(2 * flight.n());
    flight.state(x, t, q, u);
    both << q, u;
    return both;
  }
  static void fly(Flight& flight, const State& start, double t, double tau, ContactSet held) {
    Eigen::VectorXd x(2 * flight.n());
    flight.enter(start.q, start.u, t, x);
    flight.fly(x, t, tau, held);
  }
};

// All sets of contacts that can be held together.
std::vector<ContactSet> held_sets(const Flight& flight) {
  std::vector<ContactSet> sets;
  for (ContactSet held = 0; held < bit(flight.contacts()); ++held) {
    if (flight.can_hold(held)) sets.push_back(held);
  }
  return sets;
}

// Half of the machines have restitutions by speed.
Scene impacting_scene(Random& random) {
  ImpactingMachine machine = random_impacting_machine(random);
  if (random.chance(0.5)) test::let_restitutions_fall(random, 3.0, machine.model);
  Scene scene;
  scene.model = std::move(machine.model);
  scene.truth.start = scene.prior.start = std::move(machine.start);
  return scene;
}

void expect_near(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double share) {
  EXPECT_LT((a - b).norm(), share * (1.0 + b.norm())) << a.transpose() << "\n\n" << b.transpose();
}

// Without unknowns: any damping, any held set, impacts while others are held.
TEST(FamilyFlight, EqualsExactFlowsOfDrawnMachines) {
  constexpr std::uint64_t first_seed = 600;
  std::size_t several = 0;
  for (int k = 0; k < repetitions(60); ++k) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(k);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Scene scene = impacting_scene(random);
    Both both(scene, {});
    const double t = random.uniform(0.0, 5.0), tau = random.uniform(-0.3, 3.0);
    const Eigen::MatrixXd dq = random.matrix(2 * both.of_model.n(), 3);
    for (const ContactSet held : held_sets(both.of_family)) {
      SCOPED_TRACE(testing::Message() << "held " << held << ", tau " << tau);
      several += (held & (held - 1)) != 0 ? 1 : 0;
      const double growth = tau < 0.0 ? 1e2 : 1.0;
      std::array<Eigen::VectorXd, 2> states, gaps, struck, forces;
      std::array<Eigen::MatrixXd, 2> carried;
      std::array<ContactSet, 2> after{};
      std::size_t j = 0;
      for (Flight* of : std::initializer_list<Flight*>{&both.of_model, &both.of_family}) {
        Both::fly(*of, scene.truth.start, t, tau, held);
        states[j] = Both::state(*of, t + tau);
        carried[j] = of->from_state() * dq;
        of->carry(carried[j]);
        carried[j] = of->to_state() * carried[j];
        gaps[j].resize(3 * of->contacts());
        forces[j].setZero(2 * of->contacts());
        for (int i = 0; i < of->contacts(); ++i) {
          const Flight::Gap gap = of->gap(i);
          gaps[j].segment(3 * i, 3) << gap.g, gap.velocity, gap.acceleration;
          if (!contains(held, i)) continue;
          const Flight::Gap force = of->force(i);
          forces[j].segment(2 * i, 2) << force.g, force.velocity;
        }
        constexpr int contact = 0;
        const bool stays = k % 2 == 0;
        after[j] = of->strike(contact, stays, held & ~bit(contact));
        struck[j] = Both::state(*of, t + tau);
        ++j;
      }
      expect_near(states[1], states[0], growth * 1e-10);
      expect_near(carried[1], carried[0], growth * 1e-10);
      expect_near(gaps[1], gaps[0], growth * 1e-9);
      expect_near(forces[1], forces[0], growth * 1e-9);
      expect_near(struck[1], struck[0], growth * 1e-10);
      EXPECT_EQ(after[1], after[0]);
    }
  }
  // Enough of the held sets have several contacts.
  EXPECT_GE(several, static_cast<std::size_t>(repetitions(60)) / 3);
}

// By a parameter, through flights with held contacts and an impact: compared with the exact flows
// of neighbouring machines.
void expect_exact_derivatives(const Scene& scene, const Parameter& unknown, double tau,
                              bool stays) {
  const double t = 0.4, step = 1e-5;
  const int contact = static_cast<int>(scene.model.contacts.size()) - 1;
  FamilyFlight flight(scene, {unknown});
  flight.set(Eigen::VectorXd::Zero(1), true);
  for (const ContactSet held : held_sets(flight)) {
    if (contains(held, contact)) continue;
    SCOPED_TRACE(testing::Message() << unknown.key << ", held " << held);
    const auto end_of = [&](Flight& of) {
      Both::fly(of, scene.truth.start, t, tau, held);
      of.strike(contact, stays, held);
      return Both::state(of, t + tau);
    };
    const auto neighbour = [&](double c) {
      const auto value = Eigen::VectorXd::Constant(1, unknown.value(c));
      ModelFlight of(std::make_shared<Flows>(with(scene, {unknown}, value).model));
      return end_of(of);
    };
    end_of(flight);
    const Eigen::MatrixXd by_unknown = flight.to_state() * flight.by_unknowns();
    expect_near(by_unknown, (neighbour(step) - neighbour(-step)) / (2.0 * step), 1e-5);
  }
}

// By each number of drawn machines and by common factors.
TEST(FamilyFlight, DerivativesEqualDifferencesOfNeighbouringMachines) {
  constexpr std::uint64_t first_seed = 700;
  for (int k = 0; k < repetitions(30); ++k) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(k);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Scene scene = impacting_scene(random);
    std::vector<Parameter> unknowns = parameters_of(scene);
    for (Parameter& common : common_parameters(scene)) unknowns.push_back(std::move(common));
    // The exact flows have no negative damping.
    if (scene.model.C(0, 0) > 0.0) unknowns.push_back(parameter_of(scene, "system.C.1.1"));
    if (!scene.model.K.isZero(0.0)) {
      unknowns.push_back(parameter_of(scene, "system.K.1.1"));
      if (scene.model.coordinates() > 1) unknowns.push_back(parameter_of(scene, "system.K.1.2"));
    }
    for (const char* key : {"system.M.1.1", "contact.1.direction.1", "force.1.direction.1",
                            "force.1.frequency", "force.1.phase"}) {
      if (scene_number(scene, key)) unknowns.push_back(parameter_of(scene, key));
    }
    if (scene.model.coordinates() > 1) unknowns.push_back(parameter_of(scene, "system.M.1.2"));
    const double tau = random.uniform(0.1, 1.0);
    for (const Parameter& unknown : unknowns) {
      expect_exact_derivatives(scene, unknown, tau, k % 3 == 0);
    }
  }
}

// Numbers from which others follow: the matrices and directions of a beam, the force of a frame.
TEST(FamilyFlight, DerivativesIncludeWhatFollowsFromANumber) {
  for (const char* name : {"two_stops_beam", "swept_beam", "lab_rig"}) {
    SCOPED_TRACE(name);
    const Scene scene = shipped_scene(name);
    for (const char* key :
         {"beam.length", "beam.mass_per_length", "beam.damping_ratio.2", "system.M.1.1",
          "system.M.1.2", "excitation.influence.1", "contact.1.direction.2"}) {
      if (!scene_number(scene, key)) continue;
      expect_exact_derivatives(scene, parameter_of(scene, key), 0.37, false);
    }
  }
}

// A sustained contact over many samples of a record, with damping that couples the modes.
TEST(FamilyFlight, FollowsManySamplesWhileContactsAreHeld) {
  Scene scene = test::shaken_by_record(shipped_scene("two_stops_beam"), 1e-3, 21.0);
  scene.beam = {};
  scene.positions = {};
  scene.model.C(0, 1) = scene.model.C(1, 0) = 0.3 * scene.model.C(0, 0);
  Both both(scene, {});
  for (const double tau : {0.7, -0.7}) {
    for (const ContactSet held : held_sets(both.of_family)) {
      SCOPED_TRACE(testing::Message() << "held " << held);
      Both::fly(both.of_model, scene.truth.start, 3.0001, tau, held);
      Both::fly(both.of_family, scene.truth.start, 3.0001, tau, held);
      const Eigen::VectorXd exact = Both::state(both.of_model, 3.0001 + tau);
      const Eigen::VectorXd state = Both::state(both.of_family, 3.0001 + tau);
      EXPECT_LT((state - exact).norm(), 1e-9 * exact.norm()) << state.transpose();
    }
  }
}

// By a clock that runs fast, the same motion takes longer and has smaller velocities.
TEST(FamilyFlight, ClockStretchesTheMotion) {
  constexpr double rate = 1.01;
  for (const char* name : {"paper_beam", "two_stops_beam", "lab_rig"}) {
    SCOPED_TRACE(name);
    const Scene scene = shipped_scene(name);
    const Parameter of_clock = parameter_of(scene, "clock.rate");
    FamilyFlight flight(scene, {of_clock}), by_clock(scene, {of_clock});
    const Eigen::Index n = flight.n();
    Eigen::VectorXd x(2 * n);
    flight.enter(scene.prior.start.q, scene.prior.start.u, 0.0, x);
    flight.set(Eigen::VectorXd::Zero(1), false);
    flight.fly(x, 0.3, 0.2, 0);
    x.tail(n) /= rate;
    by_clock.set(Eigen::VectorXd::Constant(1, of_clock.coordinate(rate)), false);
    by_clock.fly(x, 0.3 * rate, 0.2 * rate, 0);
    const Eigen::VectorXd q = flight.x().head(n), u = flight.x().tail(n) / rate;
    EXPECT_LT((by_clock.x().head(n) - q).norm(), 1e-10 * q.norm());
    EXPECT_LT((by_clock.x().tail(n) - u).norm(), 1e-10 * u.norm());
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, FamilyFlightOfScenes,
                         testing::Values("paper_beam", "two_stops_beam", "lab_rig", "swept_beam",
                                         "paper_beam@", "two_stops_beam@"));

TEST(EventFilter, RestartKeepsEstimatedParameters) {
  constexpr std::uint64_t seed = 7;
  Random random(seed);
  Scene scene = shipped_scene("paper_beam");
  scene.prior.adaptation.walk[0] = 0.3;
  FamilyFlight flight(scene, unknowns_to_adapt(scene));
  EventFilter filter(flight, {walk_of(scene, flight.unknowns())});
  FilterBelief belief = filter.no_belief();
  const Eigen::Index n2 = 2 * filter.n(), P = filter.unknowns();
  for (Eigen::Index i = 0; i < belief.S.rows(); ++i) {
    belief.S.row(i) = random.vector(belief.S.cols()).transpose();
  }
  const Eigen::MatrixXd before = product(belief.S, belief.S.transpose());
  const Eigen::MatrixXd wide = 3.0 * Eigen::MatrixXd::Identity(n2, n2);
  filter.restart(4.0, Eigen::VectorXd::Ones(n2), wide, 0, belief);
  const Eigen::MatrixXd after = product(belief.S, belief.S.transpose());
  EXPECT_TRUE(after.topLeftCorner(n2, n2).isApprox(9.0 * Eigen::MatrixXd::Identity(n2, n2)));
  EXPECT_TRUE(after.topRightCorner(n2, P).isZero(1e-12));
  // The covariance of a walk over four units of time is added.
  const Eigen::MatrixXd walked = 0.36 * Eigen::MatrixXd::Identity(P, P);
  EXPECT_TRUE(after.bottomRightCorner(P, P).isApprox(before.bottomRightCorner(P, P) + walked));
  EXPECT_EQ(belief.z.head(n2), Eigen::VectorXd::Ones(n2));
  EXPECT_EQ(belief.t, 4.0);
}

}  // namespace
}  // namespace sprag
