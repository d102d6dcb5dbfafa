// The studies' tools do what they say, and what docs/robustness.md says holds on short runs.
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>

#include "sprag/mechanics/scalars.h"
#include "studies/robustness/machines.h"
#include "studies/robustness/studies.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag::robustness {
namespace {

const Scene& beam() {
  static const Scene scene = read_paper_beam(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  return scene;
}

using Events = std::vector<ContactEvent>;

// Two contacts that pulse, close and open, about three events per unit of time.
Events random_events(std::uint64_t seed, double end) {
  sprag::Random random(seed);
  Events events;
  ContactSet chi = 0;
  for (double t = random.uniform(0.0, 0.7); t < end; t += random.uniform(0.0, 0.7)) {
    const int contact = random.integer(0, 1);
    ContactEventKind kind = random.chance(0.7) ? ContactEventKind::pulse : ContactEventKind::closes;
    if (contains(chi, contact)) kind = ContactEventKind::opens;
    events.push_back({t, contact, kind});
    chi = after(chi, events.back());
  }
  return events;
}

bool consistent(const Events& events) {
  Events kept = events;
  drop_contradicting(kept);
  return kept == events;
}

TEST(Tolerance, UndisturbedEventsArriveAsTheyAre) {
  const Events events = random_events(1, 50.0);
  EXPECT_EQ(disturb(events, {}, 2, 50.0, 1), events);
}

TEST(Tolerance, DisturbedEventsAreInOrderAndDoNotContradict) {
  constexpr double end = 50.0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Events events = random_events(seed, end);
    const double sign = seed % 2 == 0 ? 1.0 : -1.0;
    const Events arrived = disturb(events, {0.5, 0.2 * sign, 0.1, 0.5}, 2, end, seed);
    EXPECT_NE(arrived, events);
    EXPECT_TRUE(consistent(arrived)) << "seed " << seed;
    double last = 0.0;
    for (const ContactEvent& event : arrived) {
      EXPECT_GE(event.t, last) << "seed " << seed;
      EXPECT_LE(event.t, end) << "seed " << seed;
      last = event.t;
    }
  }
}

TEST(Tolerance, ContradictingEventsAreDropped) {
  using enum ContactEventKind;
  Events events{{0.1, 0, opens},  {0.2, 0, closes}, {0.3, 0, pulse}, {0.3, 1, pulse},
                {0.4, 0, closes}, {0.5, 0, opens},  {0.6, 0, opens}};
  drop_contradicting(events);
  EXPECT_EQ(events, (Events{{0.2, 0, closes}, {0.3, 1, pulse}, {0.5, 0, opens}}));
}

TEST(Tolerance, SharesAndRatesAreAsAskedFor) {
  constexpr double end = 20000.0;
  Events events;
  for (double t = 0.5; t < end; t += 1.0) events.push_back({t, 0, ContactEventKind::pulse});
  const auto n = static_cast<double>(events.size());
  const Events less = disturb(events, {0.0, 0.0, 0.3, 0.0}, 1, end, 1);
  EXPECT_NEAR(static_cast<double>(less.size()) / n, 0.7, 5.0 * std::sqrt(0.21 / n));
  const Events more = disturb(events, {0.0, 0.0, 0.0, 0.3}, 1, end, 1);
  EXPECT_NEAR(static_cast<double>(more.size()) / n, 1.3, 5.0 * std::sqrt(0.3 / n));
  const Events moved = disturb(events, {1e-3, 1e-2, 0.0, 0.0}, 1, end, 1);
  double mean = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const double off = moved[i].t - events[i].t - 1e-2;
    mean += off / n;
    square += off * off / n;
  }
  EXPECT_NEAR(mean, 0.0, 5e-3 / std::sqrt(n));
  EXPECT_NEAR(square, 1e-6, 5e-6 * std::sqrt(2.0 / n));
}

TEST(Tolerance, QuantilesAreLinearBetweenTheValues) {
  EXPECT_EQ(quantile({3.0}, 0.95), 3.0);
  EXPECT_EQ(quantile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 0.5), 2.5);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 0.0), 1.0);
  EXPECT_EQ(quantile({4.0, 1.0, 2.0, 3.0}, 1.0), 4.0);
  EXPECT_EQ(quantile({infinity, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_EQ(quantile({infinity, infinity, 2.0}, 0.75), infinity);
}

TEST(Tolerance, APowerLawIsFoundExactly) {
  const std::vector<double> x{1e-5, 3e-5, 1e-3, 0.2};
  std::vector<double> y;
  for (const double of : x) y.push_back(7.0 * std::pow(of, 1.5));
  const PowerLaw law = fit_power_law(x, y);
  EXPECT_NEAR(law.exponent, 1.5, 1e-13);
  EXPECT_NEAR(law.factor, 7.0, 1e-11);
  EXPECT_NEAR(law.off, 1.0, 1e-12);
  y[2] *= 2.0;
  EXPECT_GT(fit_power_law(x, y).off, 1.3);
}

TEST(Tolerance, AThresholdIsTheFirstCrossing) {
  const std::vector<double> x{1e-3, 1e-2, 1e-1, 1.0};
  const Threshold between = stays_below(1e-4, x, std::vector{1e-6, 1e-5, 1e-3, 1e-6});
  EXPECT_NEAR(between.x, std::pow(10.0, -1.5), 1e-15);
  EXPECT_FALSE(between.beyond);
  EXPECT_EQ(stays_below(1e-4, x, std::vector{1e-4, 1e-6, 1e-6, 1e-6}).x, 0.0);
  EXPECT_EQ(stays_below(1e-4, x, std::vector{1e-6, 1e-6, 1e-6, 1e-6}).x, 1.0);
  EXPECT_TRUE(stays_below(1e-4, x, std::vector{1e-6, 1e-6, 1e-6, 1e-6}).beyond);
}

TEST(Tolerance, StartsAreOutsideTheSupportAndDiffer) {
  const Contact& contact = beam().model.contacts[0];
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = with_random_start(beam(), seed);
    EXPECT_GT(gap(contact, scene.master.q, 0.0), 0.0) << "seed " << seed;
    EXPECT_NE(scene.master.q, with_random_start(beam(), seed + 1).master.q);
  }
}

TEST(Tolerance, MachinesAreWrongAsSaid) {
  const auto wrong = [](Wrong what, double deviation) {
    return with_wrong(beam(), what, deviation).model;
  };
  const Model& right = beam().model;
  EXPECT_NEAR(wrong(Wrong::restitution, -0.1).contacts[0].restitution, 0.63, 1e-15);
  EXPECT_TRUE(wrong(Wrong::damping, 0.2).C.isApprox(1.2 * right.C, 1e-14));
  EXPECT_TRUE(wrong(Wrong::stiffness, 0.2).K.isApprox(1.2 * right.K, 1e-14));
  EXPECT_NEAR(wrong(Wrong::clearance, 0.01).contacts[0].clearance, 0.01, 1e-15);
  EXPECT_NEAR(wrong(Wrong::phase, 0.5).contacts[0].motion.phase, 0.5, 1e-15);
  EXPECT_NEAR(wrong(Wrong::amplitude, 0.5).contacts[0].motion.amplitude, 0.045, 1e-15);
  EXPECT_TRUE(
      wrong(Wrong::position, 0.1).contacts[0].w.isApprox(mode_shapes(*beam().beam, 0.9548), 1e-13));
  const Model more = with_modes(beam(), 5).model;
  EXPECT_EQ(more.coordinates(), 5);
  EXPECT_EQ(more.contacts[0].w.head(3), right.contacts[0].w);
  EXPECT_EQ(with_modes(beam(), 3).model.forces[0].direction, right.forces[0].direction);
}

// With the events as they are, on runs long enough for the replica to be on its way.
TEST(Tolerance, WithoutDisturbanceAllMethodsSynchronize) {
  const Sampling sampling{100.0, 0.1, 1e-2, 1e-3};
  const Scene scene = with_random_start(beam(), 1);
  const Truth truth = simulate(scene, sampling);
  const auto floor = [&](Method method) {
    return quantile(error_energies(method, beam(), truth.events, truth, sampling), 0.5);
  };
  EXPECT_LT(floor(Method::replica), 1e-5);
  EXPECT_LT(floor(Method::moreau), 1e-4);
  EXPECT_LT(floor(Method::forced), 1e-5);
  EXPECT_LT(floor(Method::timing), 1e-20);
  EXPECT_LT(floor(Method::both), 1e-20);
}

TEST(Tolerance, ReplicasSideBySideAreThoseThatRunAlone) {
  const Sampling sampling{20.0, 0.1, 1e-2, 1e-3};
  std::vector<Told> told;
  std::vector<Truth> truths;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    truths.push_back(simulate(with_random_start(beam(), seed), sampling));
    told.push_back({beam(), disturb(truths.back().events, {.jitter = 1e-3}, 1, 20.0, seed)});
    told.back().believed.model.C *= 1.0 + 0.01 * static_cast<double>(seed);
  }
  const auto together = replica_energies(told, truths, sampling);
  for (std::size_t i = 0; i < told.size(); ++i) {
    EXPECT_EQ(together[i], error_energies(Method::replica, told[i].believed, told[i].events,
                                          truths[i], sampling));
  }
}

const Study& study_of(const std::string& name) {
  static const std::vector<Study> all = studies(beam());
  return *std::find_if(all.begin(), all.end(), [&](const Study& one) { return one.name == name; });
}

Options quick() {
  Options options;
  options.sampling.duration = 120.0;
  options.runs = repetitions(6);
  std::cout << "seeds 1 to " << options.runs << '\n';
  return options;
}

TEST(Tolerance, VFallsWithTheSquareOfTheJitter) {
  Study study = study_of("jitter");
  study.amounts = {0.0, 1e-4, 3e-4, 1e-3, 3e-3};
  study.methods = {Method::replica, Method::timing, Method::both};
  const auto points = measure(study, beam(), quick(), [] {});
  for (std::size_t j = 0; j < study.methods.size(); ++j) {
    const Slope law = slope(study, points, j);
    std::cout << name(study.methods[j]) << ": V ~ sigma^" << law.law.exponent << '\n';
    EXPECT_GE(law.points, 3);
    EXPECT_NEAR(law.law.exponent, 2.0, sanitized ? 0.4 : 0.2);
  }
}

TEST(Tolerance, BothAreNeverMuchWorseThanTheReplica) {
  for (const auto& [of, amount] : {std::pair("missed", 0.05), std::pair("spurious", 0.1),
                                   std::pair("stiffness", 0.03), std::pair("clearance", 0.01)}) {
    Study study = study_of(of);
    study.amounts = {amount};
    study.methods = {Method::replica, Method::timing, Method::both};
    const Point point = measure(study, beam(), quick(), [] {})[0];
    std::cout << of << " " << amount << ": V replica " << point.median(0) << ", timing "
              << point.median(1) << ", both " << point.median(2) << '\n';
    EXPECT_LE(point.median(2), 10.0 * point.median(0)) << of;
    EXPECT_LE(point.share_worse[2], 0.05) << of;
  }
}

}  // namespace
}  // namespace sprag::robustness
