#include "sprag/detail/replica/replica_sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/random_events.h"
#include "tests/support/random_model.h"
#include "tests/support/run.h"

namespace sprag {
namespace {

bool same_bits(const Eigen::ArrayXd& a, const Eigen::ArrayXd& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(double)) == 0;
}

bool same_bits(const ReplicaState& a, const ReplicaState& b) {
  return a.tick == b.tick && a.chi == b.chi && a.idle == b.idle &&
         a.refused_impacts == b.refused_impacts && a.motion.flow == b.motion.flow &&
         std::memcmp(&a.motion.t, &b.motion.t, sizeof a.motion.t) == 0 &&
         same_bits(a.motion.x.z, b.motion.x.z) && same_bits(a.motion.x.v, b.motion.x.v) &&
         same_bits(a.motion.alpha, b.motion.alpha) &&
         a.anchor.ticks_since == b.anchor.ticks_since && same_bits(a.anchor.x.z, b.anchor.x.z) &&
         same_bits(a.anchor.x.v, b.anchor.x.v);
}

/// A replica with ticks of its own.
struct Single {
  Single(const ReplicaSweep::Run& run, double h)
      : replica(run.flows, h), events(run.events), ticks(run.ticks) {
    replica.start(run.start, 0, run.chi, state);
    const auto at_start = up_to(0);
    if (!at_start.empty()) replica.apply(at_start, state);
  }

  std::span<const ContactEvent> up_to(std::int64_t k) {
    std::size_t due = 0;
    const double t = tick_instant(k, replica.h()).hi;
    while (due < events.size() && events[due].t <= t) ++due;
    const auto taken = events.first(due);
    events = events.subspan(due);
    return taken;
  }

  void run(std::int64_t k) {
    while (state.tick < std::min(k, ticks)) {
      replica.tick(up_to(state.tick + 1), state);
      if (state.chi != 0) ++closed_ticks;
      if (state.motion.flow->locked() != 0) ++locked_ticks;
    }
  }

  Replica replica;
  ReplicaState state;
  std::span<const ContactEvent> events;
  std::int64_t ticks;
  long closed_ticks = 0, locked_ticks = 0;
};

struct Met {
  long closed_ticks = 0, locked_ticks = 0;
  int driven = 0, drifting = 0;
};

/// Compares after irregular numbers of ticks.
Met expect_equal(const std::vector<ReplicaSweep::Run>& runs, double h, std::int64_t ticks) {
  ReplicaSweep sweep(runs, h);
  std::vector<std::unique_ptr<Single>> singles;
  for (const ReplicaSweep::Run& run : runs) singles.push_back(std::make_unique<Single>(run, h));
  std::int64_t step = 1;
  for (std::int64_t k = 0; k <= ticks; k += step, step = step * 7 % 311 + 1) {
    sweep.run(k);
    for (std::size_t i = 0; i < runs.size(); ++i) {
      singles[i]->run(k);
      EXPECT_TRUE(same_bits(sweep.state(i), singles[i]->state)) << "tick " << k << " of run " << i;
      if (testing::Test::HasFailure()) return {};
    }
  }
  Met met;
  for (const auto& single : singles) {
    met.closed_ticks += single->closed_ticks;
    met.locked_ticks += single->locked_ticks;
    met.driven += single->replica.flight().driven() ? 1 : 0;
    met.drifting += single->replica.flight().drifts() ? 1 : 0;
  }
  return met;
}

TEST(ReplicaSweep, OfRandomMachinesEqualsReplicasBitForBit) {
  constexpr double h = 1e-2;
  Met met;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const int f = random.integer(1, 9);
    const int contacts = random.integer(1, std::min(f, 3));
    const int count = random.integer(1, 8);
    std::vector<std::vector<ContactEvent>> events(8);
    std::vector<ReplicaSweep::Run> runs;
    const int forces = random.integer(0, 2);
    while (runs.size() < static_cast<std::size_t>(count)) {
      const auto structure = structures.at(static_cast<std::size_t>(random.integer(0, 9)));
      Model model = random_machine(random, structure, f);
      const bool pushed = random.chance(0.5);
      add_forces(random, model, forces);
      if (!pushed) {
        for (Force& force : model.forces) force.constant = 0.0;
      }
      add_contacts(random, model, contacts);
      auto& of_run = events[runs.size()];
      of_run = random_events(random, contacts, 300, 0.0, random.log_uniform(0.02, 2.0));
      try {
        ReplicaSweep::Run run{std::make_shared<Flows>(model), random_state(random, model), of_run};
        if (random.chance(0.3)) run.ticks = random.integer(0, 3000);
        if (!runs.empty() && run.flows->dynamics().frequencies().size() !=
                                 runs[0].flows->dynamics().frequencies().size()) {
          continue;
        }
        runs.push_back(run);
      } catch (const ModelError&) {
        continue;  // a constant force on a motion without stiffness, or the like
      }
    }
    const Met of_seed = expect_equal(runs, h, 4000);
    if (HasFailure()) return;
    met.closed_ticks += of_seed.closed_ticks;
    met.locked_ticks += of_seed.locked_ticks;
    met.drifting += of_seed.drifting;
  }
  EXPECT_GT(met.closed_ticks, 1000);
  EXPECT_GT(met.locked_ticks, 1000);
  EXPECT_GT(met.drifting, 5);
}

// Chatter and sustained contacts of masters that differ slightly.
TEST(ReplicaSweep, OfChatteringBeamsEqualsReplicasBitForBit) {
  Scene scene = test::shipped_scene("paper_beam_chatter");
  std::vector<std::vector<ContactEvent>> events(5);
  std::vector<ReplicaSweep::Run> runs;
  for (std::size_t i = 0; i < events.size(); ++i) {
    scene.model.K *= 1.0 + 1e-3 * static_cast<double>(i);
    events[i] = test::events_of(scene, 20.0);
    runs.push_back({std::make_shared<Flows>(scene.model), scene.prior.start, events[i]});
  }
  const Met met = expect_equal(runs, 1e-3, 20000);
  EXPECT_GT(met.locked_ticks, 100);
}

// A force on one lane adds nothing to another, where +0 would turn -0 into +0.
TEST(ReplicaSweep, KeepsSignedZerosOfUnforcedLanes) {
  Random random(8);
  std::vector<ReplicaSweep::Run> runs;
  for (const double constant : {0.0, 1.0}) {
    Model model = random_machine(random, Structure::diagonal, 2);
    model.forces = {{Eigen::Vector2d::Ones(), constant, {}}};
    const State start{Eigen::Vector2d::Constant(-0.0), Eigen::Vector2d::Constant(-0.0)};
    runs.push_back({std::make_shared<Flows>(model), start, {}});
  }
  const Met met = expect_equal(runs, 1e-3, 10);
  EXPECT_EQ(met.drifting, 1);
}

// A force near resonance is computed without vectors.
TEST(ReplicaSweep, OfMachineAtResonanceEqualsReplicasBitForBit) {
  Random random(7);
  std::vector<ReplicaSweep::Run> runs;
  for (const double Omega : {1.0, 3.0}) {
    Model model = random_machine(random, Structure::no_stiffness_no_damping, 2);
    model.M.setIdentity();
    model.K = Eigen::Vector2d(1.0, 2.0).asDiagonal();
    add_forces(random, model, 1);
    for (Force& force : model.forces) {
      force.constant = 0.0;
      force.harmonic = {1.0, Omega, 0.0};
    }
    runs.push_back({std::make_shared<Flows>(model), random_state(random, model), {}});
  }
  const Met met = expect_equal(runs, 1e-2, 1000);
  EXPECT_EQ(met.driven, 1);
}

// A contact that is closed at the start of the events.
TEST(ReplicaSweep, TakesEventsOfTheStartAndBeforeItAtTheStart) {
  Scene scene = test::shipped_scene("bouncing_ball");
  scene.prior.start = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, -1.0)};
  std::vector<std::vector<ContactEvent>> events(3);
  std::vector<ReplicaSweep::Run> runs;
  for (std::size_t i = 0; i < events.size(); ++i) {
    events[i] = {{-0.1 * static_cast<double>(i), 0, ContactEventKind::closes},
                 {0.013, 0, ContactEventKind::opens}};
    runs.push_back({std::make_shared<Flows>(scene.model), scene.prior.start, events[i]});
  }
  const Met met = expect_equal(runs, 1e-3, 100);
  EXPECT_EQ(met.locked_ticks, 3 * 12);
}

TEST(ReplicaSweep, TakesOneToEightRunsOfOneStructure) {
  const Scene beam = test::shipped_scene("paper_beam");
  const Scene others = test::shipped_scene("two_stops_beam");
  const ReplicaSweep::Run run{std::make_shared<Flows>(beam.model), beam.prior.start, {}};
  const ReplicaSweep::Run other{std::make_shared<Flows>(others.model), others.prior.start, {}};
  EXPECT_THROW(ReplicaSweep({}, 1e-3), ModelError);
  EXPECT_THROW(ReplicaSweep(std::vector(9, run), 1e-3), ModelError);
  EXPECT_THROW(ReplicaSweep(std::vector({run, other}), 1e-3), ModelError);
  EXPECT_NO_THROW(ReplicaSweep(std::vector(8, run), 1e-3));
}

}  // namespace
}  // namespace sprag
