#include "sprag/detail/filter/family_flight.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "sprag/detail/filter/event_filter.h"
#include "sprag/detail/identification/task.h"
#include "sprag/master.h"
#include "tests/support/random.h"
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
std::vector<Unknown> unknowns_of_flight(const Scene& scene) {
  std::vector<Unknown> unknowns = unknowns_to_adapt(scene);
  for (const RecordedInput& record : recorded_inputs(scene)) {
    const std::string gain = record.key + ".gain";
    const auto has = [&](const Unknown& of) { return of.key == gain; };
    if (std::none_of(unknowns.begin(), unknowns.end(), has)) {
      unknowns.push_back(unknown_of(scene, gain));
    }
  }
  return unknowns;
}

class FamilyFlightOfScenes : public testing::TestWithParam<const char*> {};

// The machine's own path with all its forces, forwards and backwards.
TEST_P(FamilyFlightOfScenes, EqualsMotionOfMachine) {
  const Scene scene = scene_of(GetParam());
  const MachineFamily family(scene, unknowns_of_flight(scene));
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  master.advance(at(std::min(end_of_inputs(scene.model), 100.0)), events, 1);
  ASSERT_FALSE(events.empty());
  FamilyFlight flight(family);
  Eigen::VectorXd c(flight.unknowns());
  for (Eigen::Index k = 0; k < c.size(); ++k) {
    const Unknown& unknown = family.unknowns()[static_cast<std::size_t>(k)];
    c[k] = unknown.coordinate(unknown.nominal);
  }
  flight.set(c, true);
  Eigen::VectorXd start(2 * family.n());
  start << family.to_modes(scene.truth.start.q), family.to_modes(scene.truth.start.u);
  const double tau = events.front().t;
  flight.fly(start, 0.0, tau, 0);
  const double length = flight.gap(events.front().contact).length;
  EXPECT_NEAR(flight.gap(events.front().contact).g, 0.0, 1e-11 * length);
  EXPECT_LT(flight.gap(events.front().contact).velocity, 0.0);
  const Eigen::VectorXd there = flight.x();
  flight.fly(there, tau, -tau, 0);
  EXPECT_LT((flight.x() - start).cwiseAbs().maxCoeff(), 1e-9 * there.cwiseAbs().maxCoeff());
}

// Derivatives through an impact, compared with difference quotients of whole flights.
TEST_P(FamilyFlightOfScenes, DerivativesMatchDifferenceQuotients) {
  constexpr std::uint64_t seed = 20261123;
  SCOPED_TRACE(seed);
  Random random(seed);
  const Scene scene = scene_of(GetParam());
  const MachineFamily family(scene, unknowns_of_flight(scene));
  FamilyFlight flight(family), other(family);
  const Eigen::Index n = family.n(), P = flight.unknowns();
  Eigen::VectorXd x(2 * n), c(P);
  x << family.to_modes(scene.prior.start.q), family.to_modes(scene.prior.start.u);
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
    SCOPED_TRACE(family.unknowns()[static_cast<std::size_t>(k)].key);
    expect_same(of_c, difference(no_x, Eigen::VectorXd::Unit(P, k), 0.0));
  }
}

// A sustained contact, between the end of a chatter and the next opening.
TEST(FamilyFlight, HoldsContactLikeMachine) {
  for (const char* name : {"paper_beam_chatter", "two_stops_beam", "steel_ruler",
                           "paper_beam_chatter@", "two_stops_beam@"}) {
    SCOPED_TRACE(name);
    const Scene scene = scene_of(name);
    const MachineFamily family(scene, unknowns_of_flight(scene));
    FamilyFlight flight(family), moved(family);
    Eigen::VectorXd c(flight.unknowns());
    for (Eigen::Index k = 0; k < c.size(); ++k) {
      const Unknown& unknown = family.unknowns()[static_cast<std::size_t>(k)];
      c[k] = unknown.coordinate(unknown.nominal);
    }
    const std::vector<ContactEvent> events = test::events_of(scene, 20.0);
    const auto closing = std::find_if(events.begin(), events.end(), [](const ContactEvent& event) {
      return event.kind == ContactEventKind::closes;
    });
    ASSERT_NE(closing, events.end());
    const double opens = std::next(closing) == events.end() ? 20.0 : std::next(closing)->t;
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> passed;
    const auto state_at = [&](double t) {
      master.advance(at(t), passed);
      Eigen::VectorXd q(family.n()), u(family.n()), x(2 * family.n());
      master.state(at(t), q, u);
      x << family.to_modes(q), family.to_modes(u);
      return x;
    };
    const double from = closing->t + 0.1 * (opens - closing->t);
    const double to = closing->t + 0.9 * (opens - closing->t);
    const Eigen::VectorXd start = state_at(from), end = state_at(to);
    flight.set(c, true);
    flight.fly(start, from, to - from, bit(closing->contact));
    EXPECT_LT((flight.x() - end).norm(), 1e-10 * end.norm()) << flight.x().transpose();
    // Differences of states.
    Eigen::VectorXd dx = Eigen::VectorXd::LinSpaced(start.size(), 0.5, 1.0) * start.norm();
    moved.set(c, false);
    moved.fly(start + 1e-3 * dx, from, to - from, bit(closing->contact));
    const Eigen::VectorXd difference = (moved.x() - flight.x()) / 1e-3;
    flight.carry(dx);
    EXPECT_LT((dx - difference).norm(), 1e-8 * difference.norm());
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
  const MachineFamily family(scene, unknowns_to_adapt(scene));
  FamilyFlight flight(family);
  EventFilter filter(flight, {walk_of(family.scene(), std::ssize(family.unknowns()))});
  FilterBelief belief = filter.no_belief();
  const Eigen::Index n2 = 2 * filter.n(), P = filter.unknowns();
  for (Eigen::Index i = 0; i < belief.S.rows(); ++i) {
    belief.S.row(i) = random.vector(belief.S.cols()).transpose();
  }
  const Eigen::MatrixXd before = belief.S * belief.S.transpose();
  const Eigen::MatrixXd wide = 3.0 * Eigen::MatrixXd::Identity(n2, n2);
  filter.restart(4.0, Eigen::VectorXd::Ones(n2), wide, 0, belief);
  const Eigen::MatrixXd after = belief.S * belief.S.transpose();
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
