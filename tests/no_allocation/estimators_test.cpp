// The estimators' ticks, with all their cases.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/no_allocation/allocations.h"
#include "tests/support/random_events.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"
#include "tests/support/tracking_estimators.h"

namespace sprag::test {
namespace {

/// A machine and its contact events.
struct Drive {
  Model model;
  State start;
  double h = 1e-3;
  std::vector<ContactEvent> events;
  std::vector<std::size_t> until;  // per tick k: events up to and including it

  std::int64_t ticks() const { return static_cast<std::int64_t>(until.size()) - 1; }

  void assign_ticks(std::int64_t count) {
    std::size_t end = 0;
    for (std::int64_t k = 0; k <= count; ++k) {
      while (end < events.size() && tick_instant(k, h) - at(events[end].t) >= 0.0) ++end;
      until.push_back(end);
    }
  }
};

Drive shipped(const std::string& name) {
  const Scene scene = shipped_scene(name);
  Drive drive{scene.model, scene.prior.start, 1e-3, events_of(scene, 30.0), {}};
  drive.assign_ticks(30000);
  return drive;
}

/// Arbitrary contact events: clutches lock and unlock by themselves, several at a time.
Drive random_drive(std::uint64_t seed, Structure structure, Eigen::Index f, int contacts) {
  Random random(seed);
  Drive drive;
  drive.model = random_machine(random, structure, f);
  add_forces(random, drive.model, 2);
  add_contacts(random, drive.model, contacts);
  drive.start = random_state(random, drive.model);
  drive.h = 1e-2;
  drive.events = random_events(random, contacts, 4000, 0.005, 0.1);
  drive.assign_ticks(20000);
  return drive;
}

ContactSet locked(const ReplicaState& state) { return state.motion.flow->locked(); }
ContactSet locked(const TrackingState& state) { return state.belief ? state.belief->held : 0; }

/// The cases that a run has covered, and its allocations.
struct Met {
  long allocations = 0;
  long free_ticks = 0;     // no contact closed
  long clutch_ticks = 0;   // some closed, not all of them locked
  long locked_ticks = 0;   // one locked
  long several_ticks = 0;  // two or more locked
  long switchings = 0;     // of clutches without an event
  long pulses = 0, closings = 0, openings = 0;
  double checksum = 0.0;
};

template <Estimator E>
Met run(E& estimator, const Drive& drive, typename E::State& state) {
  const Eigen::Index f = drive.model.coordinates();
  Eigen::VectorXd q(f), u(f);
  estimator.start(drive.start, 0, 0, state);
  Met met;
  CountAllocations counting;
  for (std::int64_t k = 1; k <= drive.ticks(); ++k) {
    const std::size_t from = drive.until[static_cast<std::size_t>(k - 1)];
    const std::size_t to = drive.until[static_cast<std::size_t>(k)];
    const std::span<const ContactEvent> events(drive.events.data() + from, to - from);
    const ContactSet before = locked(state);
    estimator.tick(events, state);
    estimator.output(state, q, u);
    met.checksum += q[0] + u[0];
    if (events.empty() && locked(state) != before) ++met.switchings;
    if (state.chi == 0) ++met.free_ticks;
    if (locked(state) != state.chi) ++met.clutch_ticks;
    if (std::popcount(locked(state)) == 1) ++met.locked_ticks;
    if (std::popcount(locked(state)) >= 2) ++met.several_ticks;
    for (const ContactEvent& event : events) {
      if (event.kind == ContactEventKind::pulse) ++met.pulses;
      if (event.kind == ContactEventKind::closes) ++met.closings;
      if (event.kind == ContactEventKind::opens) ++met.openings;
    }
  }
  met.allocations = counting.stop();
  EXPECT_TRUE(std::isfinite(met.checksum));
  return met;
}

/// A scene that uses all features of the filter.
Scene uncertain(const char* name) {
  Scene scene = shipped_scene(name);
  scene.prior.drift = 1e-6;
  scene.prior.jitter = 1e-4;
  return scene;
}

// Including the replica's estimate after a lost track, and resets.
TEST(TrackingEstimatorTick, NeverAllocatesIncludingConfidence) {
  for (const char* name : {"paper_beam", "paper_beam_chatter", "two_supports_beam"}) {
    SCOPED_TRACE(name);
    const Drive drive = shipped(name);
    Scene wrong = uncertain(name);
    for (Contact& contact : wrong.model.contacts) {
      contact.restitution *= 0.9;
      if (name != std::string("paper_beam_chatter")) contact.curve.slope = -0.05;
    }
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(wrong.model.coordinates());
    wrong.model.outputs = {{"a", ones}, {"b", ones, true}};
    BothEstimator filter(wrong, drive.h);
    TrackingState state;
    const Met met = run(filter, drive, state);
    EXPECT_EQ(met.allocations, 0);
    EXPECT_GT(state.inconsistencies, 0);
    Confidence confidence = filter.no_confidence();
    EXPECT_EQ(confidence.sigma_outputs.size(), 2);
    EXPECT_EQ(allocations_of([&] { filter.confidence(state, confidence); }), 0);
  }
}

TEST(ReplicaTick, OfFewContactsNeverAllocates) {
  for (std::size_t i = 0; i < structures.size(); ++i) {
    SCOPED_TRACE(structure_names.at(i));
    const Drive drive = random_drive(301 + i, structures.at(i), 4, 3);
    std::unique_ptr<Replica> replica;
    try {
      replica = std::make_unique<Replica>(drive.model, drive.h);
    } catch (const ModelError&) {
      continue;  // constant force on a motion without stiffness, or the like
    }
    Replica::State state;
    const Met met = run(*replica, drive, state);
    EXPECT_EQ(met.allocations, 0);
    EXPECT_GT(met.free_ticks, 100);
    EXPECT_GT(met.clutch_ticks, 100);
    EXPECT_GT(met.pulses, 500);
    EXPECT_GT(met.locked_ticks + met.several_ticks, 20);
  }
}

TEST(ReplicaTick, OfManyContactsAllocatesOnlyTheFirstTime) {
  const Drive drive = random_drive(320, Structure::simultaneous, 8, 6);
  Replica replica(drive.model, drive.h);
  Replica::State state;
  (void)run(replica, drive, state);
  const Met met = run(replica, drive, state);
  EXPECT_EQ(met.allocations, 0);
  EXPECT_GT(met.several_ticks, 100);
  EXPECT_GT(met.switchings, 100);
}

}  // namespace
}  // namespace sprag::test
