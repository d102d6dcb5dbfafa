// Replica and timing filter side by side: the choice between them, and the reports of inconsistent
// events.
#include "sprag/detail/filter/tracking_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <random>

#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "tests/support/jitter.h"
#include "tests/support/random_model.h"
#include "tests/support/recorded_run.h"
#include "tests/support/repetitions.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {
namespace {

using test::jittered;

constexpr double tick_of_both = 1e-2;
constexpr double length = 100.0;

/// Results of an estimate of the paper's beam.
struct Outcome {
  double log_replica = 0.0, log_both = 0.0;  // means of log10 V from t = 10 on
  double worse = 0.0;    // share of that time in which V is above 10 times the replica's
  double trusted = 0.0;  // share of the time with a confirmed track
  std::int64_t inconsistencies = 0;
  std::vector<Inconsistency> first;
};

Outcome outcome(const Scene& machine, const Scene& given, std::span<const ContactEvent> events) {
  const Eigen::Index f = machine.model.coordinates();
  BothEstimator both(given, tick_of_both);
  TrackingState state;
  both.start(given.prior.start, 0, 0, state);
  Master master(machine.model, machine.truth.start);
  const ErrorEnergy energy(machine.model);
  Eigen::VectorXd q_m(f), u_m(f), q(f), u(f);
  std::vector<ContactEvent> ignored;
  Outcome result;
  const auto ticks = static_cast<int>(std::lround(length / tick_of_both));
  const int from = ticks / 10;
  for (int k = 1; k <= ticks; ++k) {
    const auto later = std::find_if(events.begin(), events.end(), [&](const ContactEvent& event) {
      return event.t > tick_instant(k, tick_of_both).hi;
    });
    const auto due = events.first(static_cast<std::size_t>(later - events.begin()));
    events = events.subspan(due.size());
    both.tick(due, state);
    if (state.inconsistencies > result.inconsistencies) {
      result.inconsistencies = state.inconsistencies;
      result.first.push_back(state.last);
    }
    if (state.track.status == TrackStatus::confirmed) result.trusted += 1.0 / ticks;
    if (k <= from) continue;
    master.advance(tick_instant(k, tick_of_both), ignored);
    master.state(tick_instant(k, tick_of_both), q_m, u_m);
    const auto V = [&] { return energy(q_m, u_m, q, u)[0] + 1e-40; };
    both.replica(state, q, u);
    const double of_replica = V();
    both.output(state, q, u);
    const double of_both = V();
    const double share = 1.0 / (ticks - from);
    result.log_replica += share * std::log10(of_replica);
    result.log_both += share * std::log10(of_both);
    if (of_both > 10.0 * of_replica) result.worse += share;
  }
  return result;
}

void print(const char* what, const Outcome& o) {
  std::cout << what << ": log10 V replica " << o.log_replica << ", both " << o.log_both
            << "; above 10 times the replica's " << 100 * o.worse << " % of the time; trusted "
            << 100 * o.trusted << " %; " << o.inconsistencies << " inconsistencies\n";
}

/// The replica's start is off by `off` in each coordinate and velocity; the specified sigma is
/// `sigma`.
Scene with_start(const Scene& scene, double off, double sigma, Random& random) {
  Scene given = scene;
  const Eigen::Index f = scene.model.coordinates();
  given.prior.start.q = scene.truth.start.q + off * random.vector(f);
  given.prior.start.u = scene.truth.start.u + off * random.vector(f);
  given.prior.sigma =
      State{Eigen::VectorXd::Constant(f, sigma), Eigen::VectorXd::Constant(f, sigma)};
  return given;
}

/// Machines with enough impacts, until the end, for the filter to converge, and few enough that
/// reports with a jitter of 1 ms do not overlap.
std::vector<Scene> drawn_machines(int count, Random& random) {
  std::vector<Scene> scenes;
  while (std::ssize(scenes) < count) {
    const ImpactingMachine machine = random_impacting_machine(random);
    Scene scene;
    scene.model = machine.model;
    scene.truth.start = scene.prior.start = machine.start;
    const auto events = master_events(scene, length);
    if (events.size() < 200 || events.size() > 2000 || events.back().t < 0.9 * length) continue;
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

// Number of events less than 6 sigma after an event of another contact.
int count_close(const std::vector<ContactEvent>& events, double sigma) {
  int close = 0;
  for (std::size_t i = 1; i < events.size(); ++i) {
    const ContactEvent &one = events[i - 1], &next = events[i];
    if (one.contact != next.contact && next.t - one.t < 6.0 * sigma) ++close;
  }
  return close;
}

// The prior is much narrower than the steady state under jitter. The filter then expects a larger
// error than at the start, which is no reason to lose the track. The track may be lost if contacts
// interact within the jitter; the published estimate is then no worse than the replica.
TEST(TrackingEstimator, KeepsTrackWithNarrowPrior) {
  Random random(3);
  std::mt19937_64 engine(3);
  int better = 0, machines = 0;
  for (const Scene& scene : drawn_machines(long_repetitions(40), random)) {
    Scene given = with_start(scene, 1e-6, 1e-6, random);
    given.prior.jitter = 1e-3;
    const Outcome o =
        outcome(scene, given, jittered(master_events(scene, length), given.prior.jitter, engine));
    print("start known to 1e-6", o);
    const bool apart = count_close(master_events(scene, length), given.prior.jitter) == 0;
    EXPECT_GT(o.trusted, apart ? 0.85 : 0.0);
    EXPECT_LE(o.log_both, o.log_replica + 0.02);
    ++machines;
    if (o.log_both < o.log_replica) ++better;
  }
  EXPECT_GE(better, machines - machines / 10);
}

// The replica converges until the filter can start from it, however narrow a wrong prior is. With
// jitter this excludes contacts that interact within it.
TEST(TrackingEstimator, ConvergesFromNarrowWrongPrior) {
  Random random(5);
  std::mt19937_64 engine(5);
  for (const double jitter : {0.0, 1e-5}) {
    int found = 0, machines = 0;
    for (const Scene& scene : drawn_machines(long_repetitions(40), random)) {
      Scene given = with_start(scene, 0.3, 1e-6, random);
      given.prior.jitter = jitter;
      const Outcome o =
          outcome(scene, given, jittered(master_events(scene, length), jitter, engine));
      print("start off by 0.3, given 1e-6", o);
      ++machines;
      if (o.trusted > 0.5) ++found;
      EXPECT_LE(o.log_both, std::max(o.log_replica, -25.0) + 1.0);
    }
    EXPECT_GE(found, jitter > 0.0 ? machines - machines / 5 : machines) << jitter;
  }
}

TEST(TrackingEstimator, ReportsSpuriousAndMissingEvents) {
  const Scene& scene = cached_scene("paper_beam.toml");
  const auto events = master_events(scene, length);

  auto spurious = events;
  const double between = 0.5 * (events[60].t + events[61].t);
  spurious.insert(spurious.begin() + 61, {between, 0, ContactEventKind::pulse});
  const Outcome with = outcome(scene, scene, spurious);
  print("one spurious event", with);
  ASSERT_GE(with.first.size(), 1U);
  EXPECT_EQ(with.first[0].suspicion, Suspicion::spurious_event);
  EXPECT_EQ(with.first[0].t, between);

  auto missing = events;
  missing.erase(missing.begin() + 60);
  const Outcome without = outcome(scene, scene, missing);
  print("one missing event", without);
  ASSERT_GE(without.first.size(), 1U);
  EXPECT_EQ(without.first[0].suspicion, Suspicion::missing_event);
  // Detected before the next event, as soon as the overdue impact is beyond doubt.
  EXPECT_GT(without.first[0].t, events[60].t);
  EXPECT_LT(without.first[0].t, events[61].t);

  // The track recovers soon in both cases.
  for (const Outcome* o : {&with, &without}) {
    EXPECT_LE(o->inconsistencies, 3);
    EXPECT_GT(o->trusted, 0.7);
  }
}

// A ball whose drag and restitution differ slightly from the model's is off by a small share of
// each flight: its impacts are not spurious.
TEST(TrackingEstimator, DoesNotReportImpactOfWrongModelAsSpurious) {
  constexpr std::uint64_t seed = 5;
  std::cout << "seed " << seed << '\n';
  Random random(seed);
  int inconsistent = 0;
  for (int run = 0; run < repetitions(40); ++run) {
    Scene machine;
    machine.model.M = Eigen::MatrixXd::Identity(1, 1);
    machine.model.K = Eigen::MatrixXd::Zero(1, 1);
    machine.model.C = random.uniform(0.0, 0.3) * machine.model.M;
    machine.model.forces.push_back({Eigen::VectorXd::Constant(1, -9.81), 1.0, {}});
    Contact floor;
    floor.w = Eigen::VectorXd::Ones(1);
    floor.restitution = random.uniform(0.7, 0.95);
    machine.model.contacts = {floor};
    const double unit = random.log_uniform(0.01, 100.0);
    machine.truth.start = {Eigen::VectorXd::Constant(1, 0.3 * unit), Eigen::VectorXd::Zero(1)};
    machine.model.forces[0].direction *= unit;
    Scene given = machine;
    given.model.C += random.uniform(0.02, 0.2) * machine.model.M;
    given.model.contacts[0].restitution *= random.uniform(0.995, 1.0);
    given.prior.start = machine.truth.start;
    given.prior.start.q *= random.uniform(0.8, 1.2);
    given.prior.sigma =
        State{Eigen::VectorXd::Constant(1, 0.1 * unit), Eigen::VectorXd::Constant(1, unit)};
    given.prior.jitter = 1e-4;
    std::mt19937_64 engine(static_cast<std::uint64_t>(run));
    std::vector<ContactEvent> events = master_events(machine, 3.0);
    events =
        jittered(std::vector(events.begin(), events.begin() + std::min(16L, std::ssize(events))),
                 given.prior.jitter, engine);
    BothEstimator both(given, tick_of_both);
    std::int64_t count = 0;
    run_time_line(both, given, events, events.back().t, false, [&](const auto& state) {
      if (state.inconsistencies == count) return;
      count = state.inconsistencies;
      EXPECT_NE(state.last.suspicion, Suspicion::spurious_event)
          << "run " << run << ", t = " << state.last.t;
    });
    if (count > 0) ++inconsistent;
  }
  EXPECT_GT(inconsistent, repetitions(40) / 2);
}

struct Mismatch {
  const char* name;
  double jitter_given, jitter;
  double restitution, damping;  // factors of the specified values
};
void PrintTo(const Mismatch& m, std::ostream* out) { *out << m.name; }

class WrongModel : public testing::TestWithParam<Mismatch> {};
INSTANTIATE_TEST_SUITE_P(Mismatches, WrongModel,
                         testing::Values(Mismatch{"restitution_2_percent_exact", 0.0, 0.0, 1.02,
                                                  1.0},
                                         Mismatch{"restitution_2_percent", 1e-3, 1e-3, 1.02, 1.0},
                                         Mismatch{"restitution_10_percent", 1e-3, 1e-3, 1.1, 1.0},
                                         Mismatch{"restitution_1_percent", 1e-4, 1e-4, 0.99, 1.0},
                                         Mismatch{"damping_20_percent", 1e-4, 1e-4, 1.0, 1.2},
                                         Mismatch{"jitter_not_given", 0.0, 1e-4, 1.0, 1.0},
                                         Mismatch{"jitter_ten_times", 1e-4, 1e-3, 1.0, 1.0}),
                         [](const auto& parameter) { return std::string(parameter.param.name); });

// The error of a replica with a wrong model is bounded, that of a filter with a wrong model is not.
TEST_P(WrongModel, IsDetectedAndEstimateIsNotWorseThanReplica) {
  const Mismatch& mismatch = GetParam();
  const Scene& scene = cached_scene("paper_beam.toml");
  Scene given = scene;
  given.prior.jitter = mismatch.jitter_given;
  given.model.C *= mismatch.damping;
  for (Contact& contact : given.model.contacts) contact.restitution *= mismatch.restitution;
  std::mt19937_64 engine(5);
  const Outcome o =
      outcome(scene, given, jittered(master_events(scene, length), mismatch.jitter, engine));
  print(mismatch.name, o);
  EXPECT_GE(o.inconsistencies, 1);
  const auto blamed = std::count_if(o.first.begin(), o.first.end(), [](const Inconsistency& one) {
    return one.suspicion == Suspicion::model;
  });
  EXPECT_GE(static_cast<double>(blamed), 0.8 * static_cast<double>(o.first.size()));
  EXPECT_LT(o.log_both, o.log_replica + 0.15);
  EXPECT_LT(o.worse, 0.15);
}

TEST(TrackingEstimator, IsNotWorseThanReplicaWithSpuriousAndMissingEvents) {
  const Scene& scene = cached_scene("paper_beam.toml");
  const auto exact = master_events(scene, length);
  for (const double sigma : {0.0, 1e-3}) {
    Scene given = scene;
    given.prior.jitter = sigma;
    double gained = 0.0;
    const int runs = long_repetitions(20);
    for (int run = 0; run < runs; ++run) {
      std::mt19937_64 engine(static_cast<std::uint64_t>(run));
      std::uniform_real_distribution<double> uniform;
      auto events = jittered(exact, sigma, engine);
      std::erase_if(events, [&](const ContactEvent& event) {
        return event.kind == ContactEventKind::pulse && uniform(engine) < 0.02;
      });
      for (int i = 0; i < 5; ++i) {
        events.push_back({length * uniform(engine), 0, ContactEventKind::pulse});
      }
      std::stable_sort(events.begin(), events.end(),
                       [](const auto& a, const auto& b) { return a.t < b.t; });
      ContactSet chi = 0;
      std::erase_if(events, [&](const ContactEvent& event) {
        const bool fits = contains(chi, event.contact) == (event.kind == ContactEventKind::opens);
        if (fits) chi = after(chi, event);
        return !fits;
      });
      const Outcome o = outcome(scene, given, events);
      gained += (o.log_replica - o.log_both) / runs;
    }
    std::cout << "sigma " << sigma << ": " << gained << " decades of V below the replica\n";
    EXPECT_GT(gained, 0.0);
  }
}

// A beam that swings freely on its support is hit at the same times at any amplitude.
TEST(TrackingEstimator, ReportsUnobservableScaleOfUnforcedMachine) {
  Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  for (Force& force : scene.model.forces) {
    force.constant = 0.0;
    force.harmonic.amplitude = 0.0;
  }
  for (Contact& contact : scene.model.contacts) {
    contact.clearance = 0.0;
    contact.motion.amplitude = 0.0;
  }
  const auto last_confidence = [](const Scene& of) {
    BothEstimator both(of, tick_of_both);
    TrackingState state;
    both.start(of.prior.start, 0, 0, state);
    Master master(of.model, of.truth.start);
    std::vector<ContactEvent> events;
    for (int k = 1; k <= 1000; ++k) {
      events.clear();
      master.advance(tick_instant(k, tick_of_both), events);
      both.tick(events, state);
    }
    Confidence confidence = both.no_confidence();
    both.confidence(state, confidence);
    return confidence;
  };
  scene.prior.jitter = 1e-4;
  const Confidence open = last_confidence(scene);
  EXPECT_FALSE(open.from_filter);
  EXPECT_TRUE((open.sigma_q.array().isInf()).all());

  scene.prior.jitter = 0.0;
  EXPECT_TRUE(last_confidence(scene).from_filter) << "exact times";
  scene.prior.jitter = 1e-4;
  scene.model.contacts.front().clearance = 1e-3;
  EXPECT_TRUE(last_confidence(scene).from_filter) << "a clearance is a length to compare with";
}

// In a time line: late events, one by one, and rollbacks without a late event.
TEST(TrackingEstimator, RollbacksDoNotChangeEstimates) {
  const Scene& scene = cached_scene("paper_beam.toml");
  std::mt19937_64 engine(3);
  auto events = jittered(master_events(scene, 30.0), 1e-3, engine);
  events.insert(events.begin() + 20,
                {0.5 * (events[19].t + events[20].t), 0, ContactEventKind::pulse});
  Scene given = scene;
  given.prior.jitter = 1e-3;
  const auto run = [&](bool late) {
    BothEstimator filter(given, tick_of_both);
    std::pair<Recording, std::vector<Confidence>> settled;
    Confidence confidence = filter.no_confidence();
    run_time_line(filter, given, events, 30.0, late, [&](const auto& state) {
      settled.first.add(filter, state, 3);
      filter.confidence(state, confidence);
      settled.second.push_back(confidence);
    });
    return settled;
  };
  const auto once = run(false);
  const auto again = run(true);
  EXPECT_EQ(once.first.ticks.size(), 3001U);
  EXPECT_EQ(difference(once.first, again.first), "");
  for (std::size_t i = 0; i < once.second.size(); ++i) {
    const Confidence &a = once.second[i], &b = again.second[i];
    ASSERT_TRUE(same_bits(a.sigma_q, b.sigma_q) && same_bits(a.sigma_u, b.sigma_u)) << i;
    ASSERT_TRUE(same_bits(a.sigma_g, b.sigma_g)) << i;
    ASSERT_EQ(a.bound, b.bound) << i;
    ASSERT_EQ(a.replica.gap, b.replica.gap) << i;
    ASSERT_EQ(a.filter.gap, b.filter.gap) << i;
    ASSERT_EQ(a.from_filter, b.from_filter) << i;
    ASSERT_EQ(a.inconsistencies, b.inconsistencies) << i;
  }
  EXPECT_GE(once.second.back().inconsistencies, 1);
}

}  // namespace
}  // namespace sprag
