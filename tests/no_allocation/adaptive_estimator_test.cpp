// An adaptive estimator's ticks: before a result, at a result, with the joint filter, and through
// sustained contacts. The flights of its filter in all cases.
#include <gtest/gtest.h>

#include <cmath>

#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/live/machine_adaptation.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/run.h"
#include "tests/support/shaken_by_record.h"

namespace sprag::test {
namespace {

TEST(TrackingEstimator, TicksDoNotAllocate) {
  const Scene machine = shipped_scene("paper_beam");
  Scene given = machine;
  given.model.contacts[0].restitution = 0.68;
  given.model.outputs = {{"a", Eigen::Vector3d::Ones()}, {"b", Eigen::Vector3d::Ones(), true}};
  const std::vector<ContactEvent> events = events_of(machine, 110.0);
  constexpr double h = 0.01;
  TrackingEstimator estimator(given, h, EstimatorKind::adaptive);
  TrackingState state, saved;
  estimator.start(given.prior.start, 0, 0, state);
  estimator.start(given.prior.start, 0, 0, saved);
  Confidence confidence = estimator.no_confidence();
  Eigen::VectorXd q(3), u(3);
  MachineAdaptation adaptation(estimator);
  adaptation.start(0.0, 0);
  std::size_t next = 0;
  long allocations = 0, of_filter = 0, results = 0;
  for (std::int64_t k = 1; k <= 11000; ++k) {
    const std::size_t first = next;
    while (next < events.size() && events[next].t <= tick_instant(k, h).hi) ++next;
    const auto of_tick = std::span(events).subspan(first, next - first);
    bool wanted = false;
    allocations += allocations_of([&] {
      estimator.tick(of_tick, state);
      estimator.output(state, q, u);
      estimator.confidence(state, confidence);
      saved = state;
      wanted = adaptation.settle(of_tick, state);
    });
    if (wanted) {
      const AdaptationResult result = run(adaptation.task(), *estimator.family());
      allocations += allocations_of([&] { adaptation.finish(result, state); });
      ++results;
    }
    of_filter += confidence.from_filter ? 1 : 0;
  }
  EXPECT_EQ(allocations, 0);
  EXPECT_GE(results, 1);
  EXPECT_GT(of_filter, 8000);
}

// Free and held, with and without a record and damping that couples the modes.
TEST(FamilyFlight, DoesNotAllocate) {
  for (const bool recorded : {false, true}) {
    for (const bool coupled : {false, true}) {
      Scene scene = shipped_scene("two_stops_beam");
      if (recorded) scene = shaken_by_record(scene, 0.02, 21.0);
      if (coupled) {
        scene.beam = {};
        scene.positions = {};
        scene.model.C(0, 1) = scene.model.C(1, 0) = 0.3 * scene.model.C(0, 0);
        for (Contact& contact : scene.model.contacts) contact.curve.slope = -0.05;
      }
      std::vector<Parameter> unknowns = parameters_of(scene);
      for (const char* key : {"system.M.1.2", "contact.1.direction.1", "beam.length"}) {
        if (scene_number(scene, key)) unknowns.push_back(parameter_of(scene, key));
      }
      FamilyFlight flight(scene, unknowns);
      const Eigen::Index n2 = 2 * flight.n(), P = flight.unknowns();
      Eigen::VectorXd c = Eigen::VectorXd::Zero(P), x(n2), of_g(n2), of_velocity(n2), by_c(P),
                      velocity_by_c(P);
      Eigen::MatrixXd dx = Eigen::MatrixXd::Ones(n2, 5);
      flight.enter(scene.truth.start.q, scene.truth.start.u, 0.0, x);
      double sum = 0.0;
      const long allocations = allocations_of([&] {
        for (ContactSet held = 0; held < bit(flight.contacts()); ++held) {
          if (!flight.can_hold(held)) continue;
          c.array() += 1e-3;
          flight.set(c, true);
          flight.fly(x, 1.0, 0.13, held);
          flight.carry(dx);
          for (Eigen::Index k = 0; held == 0 && k < P; ++k) {
            if (flight.changes_flow(k)) flight.carry_by_unknown(k, dx.col(0));
          }
          flight.turn(-0.05, held, dx);
          for (int i = 0; i < flight.contacts(); ++i) {
            const bool of_force = contains(held, i);
            sum += of_force ? flight.force(i).g : flight.gap(i).g;
            flight.gradients(i, of_force, of_g, of_velocity);
            flight.differences(i, of_force, by_c, velocity_by_c);
          }
          flight.fly_on(0.02, flight.strike(0, held != 0, held & ~bit(0)));
          flight.carry_through(dx);
        }
      });
      EXPECT_EQ(allocations, 0) << recorded << coupled;
      EXPECT_TRUE(std::isfinite(sum));
    }
  }
}

}  // namespace
}  // namespace sprag::test
