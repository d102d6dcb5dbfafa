// Would catch a missed, false or late root of a gap, and a search that does not end.
#include "sprag/detail/mechanics/event_search.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/scalars.h"
#include "sprag/scene_file.h"
#include "tests/mechanics/search_problem.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

// Searches in drawn problems, which draw(random) makes, up to T.
template <typename Draw>
void check_first_roots(std::uint64_t first_seed, int count, double T, double h, const Draw& draw) {
  Tally tally;
  for (int i = 0; i < count && !testing::Test::HasFailure(); ++i) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Problem problem = draw(random);
    check_first_root(problem, search(problem, T), T, h, tally);
  }
  std::cout << "roots found " << tally.found << ", none to find " << tally.none
            << ", worst |phi(root)| " << tally.worst_residual << " of its rounding\n";
  EXPECT_GT(tally.found, sanitized ? count / 4 : count / 3);  // of few problems
  EXPECT_GT(tally.none, count / 10);
}

void lift(Random& random, double least, double most, Problem& problem) {
  shift_to(problem, problem.magnitude(*problem.start) * random.log_uniform(least, most));
}

TEST(EventSearch, FindsFirstRootOfRandomSignals) {
  check_first_roots(100000, repetitions(20000), 2.0, 1e-3, [](Random& random) {
    Problem problem = random_problem(random);
    lift(random, 1e-4, 2.0, problem);
    return problem;
  });
}

TEST(EventSearch, FindsFirstRootAtAndNearResonance) {
  check_first_roots(150000, repetitions(5000), 2.0, 1e-3, [](Random& random) {
    Problem problem = random_problem(random, 60.0, true);
    EXPECT_FALSE(problem.flow->drives().empty());
    lift(random, 1e-4, 4.0, problem);
    return problem;
  });
}

TEST(EventSearch, FindsFirstRootOfStiffBeamSignals) {
  const Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/stiff_beam.toml");
  check_first_roots(200000, repetitions(400), 0.2, 2e-5, [&](Random& random) {
    Problem problem(scene.model);
    const Eigen::Index f = scene.model.coordinates();
    const Eigen::ArrayXd w = scene.model.K.diagonal().array().sqrt();
    State state{random.vector(f), random.vector(f)};
    // Varies the share of the fast modes, which the search does not always evaluate.
    const double fall = random.uniform(0.3, 1.5);
    state.u.array() *= w.pow(-fall);
    state.q.array() *= w.pow(-fall - 1.0);
    problem.enter(state, random.uniform(0.0, 20.0));
    problem.signal = random.chance(0.5) ? problem.flow->gap(0) : problem.flow->gap_velocity(0);
    lift(random, 1e-3, 2.0, problem);
    return problem;
  });
}

// Signals with an interior minimum within T, shifted so that it is just below or above zero.
struct Graze {
  Problem problem;
  double least, where, size;
};

std::optional<Graze> random_graze(Random& random, double T, double h) {
  Problem problem = random_problem(random, 20.0);
  const Scan seen = scan(problem, T, h, infinity, false);
  if (seen.at_least < 0.2 * T || seen.at_least > T - h) return std::nullopt;
  // The parabola of the minimum is wider than rounding errors but narrower than a sample.
  const double curvature =
      (problem.slope(seen.at_least + 1e-4 * h) - problem.slope(seen.at_least - 1e-4 * h)) /
      (2e-4 * h);
  const double size = problem.magnitude(problem.moved(seen.at_least));
  if (curvature < 1.0 * size) return std::nullopt;
  if (problem.phi(0.0) - seen.least < 1e-2 * size) return std::nullopt;
  return Graze{std::move(problem), seen.least, seen.at_least, size};
}

TEST(EventSearch, FindsTouchesOfAnyDepthBetweenSamples) {
  int touches = 0;
  for (int i = 0; i < repetitions(1500); ++i) {
    const std::uint64_t seed = 300000 + static_cast<std::uint64_t>(i);
    Random random(seed);
    std::optional<Graze> graze = random_graze(random, 1.5, 2e-3);
    if (!graze) continue;
    const double constant = graze->problem.signal.constant;
    for (int exponent = -12; exponent <= -3; ++exponent) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", depth 1e" << exponent);
      const double depth = std::pow(10.0, exponent) * graze->size;
      Problem& problem = graze->problem;
      problem.signal.constant = constant - problem.sign * (graze->least + depth);
      if (problem.phi(0.0) <= 0.0) continue;
      ++touches;
      const Found found = search(problem, 1.5);
      ASSERT_TRUE(found.tau) << "missed a touch at " << graze->where;
      // Another minimum, nearly as deep, may come earlier.
      EXPECT_LE(*found.tau, graze->where);
      EXPECT_LE(std::abs(problem.phi(*found.tau)), problem.rounding(*found.tau));
    }
  }
  std::cout << "touches " << touches << '\n';
  EXPECT_GT(touches, repetitions(1500));
}

TEST(EventSearch, ReportsNoFalseTouch) {
  int misses = 0;
  for (int i = 0; i < repetitions(1500); ++i) {
    const std::uint64_t seed = 400000 + static_cast<std::uint64_t>(i);
    Random random(seed);
    std::optional<Graze> graze = random_graze(random, 1.5, 2e-3);
    if (!graze) continue;
    const double constant = graze->problem.signal.constant;
    for (int exponent = -12; exponent <= -3; ++exponent) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", height 1e" << exponent);
      const double height = std::pow(10.0, exponent) * graze->size;
      Problem& problem = graze->problem;
      problem.signal.constant = constant - problem.sign * (graze->least - height);
      ++misses;
      const Found found = search(problem, 1.49);
      EXPECT_FALSE(found.tau) << "invented a touch at " << found.tau.value_or(0.0)
                              << " where phi = " << problem.phi(found.tau.value_or(0.0));
      if (HasFailure()) return;
    }
  }
  std::cout << "near misses " << misses << '\n';
  EXPECT_GT(misses, repetitions(1500));
}

// 1 - depth + cos(w t) - 1: the first root of the undamped cosine, in closed form.
TEST(EventSearch, TouchesOfCosineMatchClosedForm) {
  for (const double w : {0.1, 1.0, 37.0, 4000.0}) {
    Model model;
    model.M = Eigen::MatrixXd::Identity(1, 1);
    model.C = Eigen::MatrixXd::Zero(1, 1);
    model.K = Eigen::MatrixXd::Constant(1, 1, w * w);
    model.contacts.push_back({Eigen::VectorXd::Ones(1), 1.0, {}, 0.5});
    Problem problem(model);
    problem.enter({Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)}, 0.0);
    problem.signal = problem.flow->gap(0);
    for (int exponent = -12; exponent <= -3; ++exponent) {
      SCOPED_TRACE(testing::Message() << "w " << w << ", 1e" << exponent);
      const double depth = std::pow(10.0, exponent);
      problem.signal.constant = 1.0 - depth;
      const double exact_depth = 1.0 - problem.signal.constant;
      const Found touch = search(problem, 10.0 / w);
      ASSERT_TRUE(touch.tau);
      const long double half_width = 2 * std::asin(std::sqrt(0.5L * exact_depth));
      const auto expected = static_cast<double>((3.14159265358979323846L - half_width) / w);
      // phi has an error of 1e-15 and the slope w sqrt(2 depth).
      EXPECT_NEAR(*touch.tau, expected, (2e-15 / std::sqrt(2 * exact_depth) + 2e-15) / w);

      problem.signal.constant = 1.0 + depth;
      const Found none = search(problem, 300.0 / w);
      EXPECT_FALSE(none.tau);
      EXPECT_GT(none.certified, 300.0 / w);
    }
  }
}

// phi, phi', ... vanish at the start by construction, up to the given order: an impact that has
// just occurred (1), a resting contact that opens (2), one released by its force (3).
class SearchFromZero : public testing::TestWithParam<int> {};

TEST_P(SearchFromZero, FindsTheFirstRootAfterTheStart) {
  const int order = GetParam();
  Tally tally;
  int tried = 0;
  for (int i = 0; tried < repetitions(4000); ++i) {
    const std::uint64_t seed =
        500000 + 100000 * static_cast<std::uint64_t>(order) + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Eigen::Index f = random.integer(1, 5);
    Model model = diagonal_machine(random, f, 0.5, 40.0);
    model.forces.push_back({random.vector(f), random.uniform(-2, 2), harmonic(random, 40.0)});
    Contact contact;
    contact.w = random.vector(f);
    if (random.chance(0.7)) contact.motion = harmonic(random, 40.0);
    model.contacts.push_back(contact);
    State state{random.vector(f), 3.0 * random.vector(f)};
    const double t = random.chance(0.5) ? 0.0 : random.uniform(0.0, 100.0);
    if (order >= 2) {
      state.u -= contact.w * (gap_velocity(contact, state.u, t) / contact.w.squaredNorm());
    }
    if (order >= 3) {
      // A constant force along w cancels the acceleration.
      Eigen::VectorXd force = -model.C * state.u - model.K * state.q;
      force += model.forces[0].direction *
               (model.forces[0].constant + value(model.forces[0].harmonic, t));
      const double w2 = contact.motion.frequency * contact.motion.frequency;
      const Eigen::VectorXd weight = model.M.diagonal().cwiseInverse();
      const double acceleration =
          contact.w.dot(weight.cwiseProduct(force)) - w2 * value(contact.motion, t);
      const double per_force = contact.w.dot(weight.cwiseProduct(contact.w));
      model.forces.push_back({contact.w, -acceleration / per_force, {}});
    }
    Problem problem(std::move(model));
    problem.enter(state, t);
    problem.signal = problem.flow->gap(0);
    shift_to(problem, 0.0);
    // The sign of the leading derivative, by the value a little later, which must be clearly
    // nonzero.
    const double h = 1e-3;
    const double soon = problem.phi(h);
    if (std::abs(soon) < 1e-3 * std::pow(h, order) * problem.magnitude(*problem.start)) continue;
    const double sooner = problem.phi(0.5 * h);
    if (std::abs(sooner / soon * std::exp2(order) - 1.0) > 0.3) continue;
    problem.sign = soon > 0.0 ? 1.0 : -1.0;
    ++tried;
    const Found found = search(problem, 1.5, order);
    if (found.tau) {
      EXPECT_GT(*found.tau, h) << "the start itself is no root";
    }
    check_first_root(problem, found, 1.5, h, tally);
    // A signal that is negative right after the start falls at once.
    problem.sign = -problem.sign;
    const Found at_once = search(problem, 1.5, order);
    ASSERT_TRUE(at_once.tau);
    EXPECT_EQ(*at_once.tau, 0.0);
    if (HasFailure()) return;
  }
  std::cout << "roots found " << tally.found << ", none to find " << tally.none
            << ", worst |phi(root)| " << tally.worst_residual << " of its rounding\n";
}

INSTANTIATE_TEST_SUITE_P(Order, SearchFromZero, testing::Values(1, 2, 3));

Model ball(double mass, double damping, double weight) {
  Model model;
  model.M = Eigen::MatrixXd::Constant(1, 1, mass);
  model.C = Eigen::MatrixXd::Constant(1, 1, damping);
  model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({Eigen::VectorXd::Ones(1), -weight, {}});
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 0.0, {}, 0.5});
  return model;
}

TEST(EventSearch, FreeFallEndsAtRootOfParabola) {
  const std::uint64_t seed = 900001;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Random random(seed);
  for (int i = 0; i < repetitions(5000); ++i) {
    const double g = random.log_uniform(1e-3, 1e3);
    const double height = random.log_uniform(1e-3, 1e3);
    const double fastest = random.log_uniform(1e-3, 1e2);
    const double v = random.uniform(-fastest, fastest);
    Problem problem(ball(1.0, 0.0, g));
    problem.enter({Eigen::VectorXd::Constant(1, height), Eigen::VectorXd::Constant(1, v)}, 0.0);
    problem.signal = problem.flow->gap(0);
    const Found found = search(problem, 1e9);
    ASSERT_TRUE(found.tau) << "g " << g << " height " << height << " v " << v;
    const long double root = std::sqrt(static_cast<long double>(v) * v + 2.0L * g * height);
    const long double expected = v > 0 ? (v + root) / g : 2.0L * height / (root - v);
    ASSERT_NEAR(static_cast<double>(*found.tau / expected), 1.0,
                4 * machine_epsilon * static_cast<double>(1 + 1e-3L / expected))
        << "g " << g << " height " << height << " v " << v;
    // From the support: order 1.
    problem.enter({Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, std::abs(v))}, 0.0);
    const Found flight = search(problem, 1e9, 1);
    ASSERT_TRUE(flight.tau);
    const double full = 2.0 * std::abs(v) / g;
    ASSERT_NEAR(*flight.tau / full, 1.0, 4 * machine_epsilon * (1 + 1e-3 / full))
        << "g " << g << " v " << v;
  }
}

// A start just above the support at high speed: phi(0) is negligible relative to the flight. A
// search without progress would never return, so it runs in a separate process.
TEST(EventSearchDeathTest, FlightFromJustAboveGroundEnds) {
  struct Flight {
    double height, v, g;
  };
  for (const Flight& flight : {Flight{1e-9, 30.0, 1.5e-3}, Flight{1e-14, 1.0, 9.81},
                               Flight{1e-16, 10.0, 9.81}, Flight{1e-30, 1.0, 9.81}}) {
    SCOPED_TRACE(testing::Message()
                 << "height " << flight.height << ", v " << flight.v << ", g " << flight.g);
    const auto fly = [&] {
      alarm(5);
      Problem problem(ball(1.0, 0.0, flight.g));
      problem.enter(
          {Eigen::VectorXd::Constant(1, flight.height), Eigen::VectorXd::Constant(1, flight.v)},
          0.0);
      problem.signal = problem.flow->gap(0);
      const Found found = search(problem, 1e9);
      const double full = 2.0 * flight.v / flight.g;
      std::exit(found.tau && std::abs(*found.tau / full - 1.0) < 1e-9 ? 0 : 1);
    };
    EXPECT_EXIT(fly(), testing::ExitedWithCode(0), "");
  }
}

TEST(EventSearch, ConstantPositiveGapIsCertifiedForAllTime) {
  // Without gravity, moving upwards or at rest above the support.
  for (const double v : {0.0, 3.0}) {
    for (const double damping : {0.0, 0.3}) {
      Problem problem(ball(1.0, damping, 0.0));
      problem.enter({Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Constant(1, v)}, 0.0);
      problem.signal = problem.flow->gap(0);
      EventSearch search;
      const Watch watch{&problem.signal, 1.0, 0, 0};
      search.begin(*problem.start, {&watch, 1});
      search.advance(1e12);
      EXPECT_FALSE(search.found()) << "v " << v << ", damping " << damping;
      EXPECT_GT(search.certified(), 1e12) << "v " << v << ", damping " << damping;
      EXPECT_LT(search.expansions(), 400) << "v " << v << ", damping " << damping;
    }
  }
  EventSearch none;
  Problem problem(ball(1.0, 0.0, 1.0));
  problem.enter({Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Zero(1)}, 0.0);
  none.begin(*problem.start, {});
  none.advance(1e12);
  EXPECT_FALSE(none.found());
  EXPECT_EQ(none.certified(), infinity);
}

TEST(EventSearch, WorkIsFewExpansionsPerPeriodAndEndsWithMotion) {
  Model model;
  model.M = Eigen::MatrixXd::Identity(1, 1);
  model.C = Eigen::MatrixXd::Zero(1, 1);
  model.K = Eigen::MatrixXd::Constant(1, 1, 1.0);
  model.contacts.push_back({Eigen::VectorXd::Ones(1), 1.5, {}, 0.5});
  {
    Problem problem(model);
    problem.enter({Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)}, 0.0);
    EventSearch search;
    const Watch watch{&problem.flow->gap(0), 1.0, 0, 0};
    search.begin(*problem.start, {&watch, 1});
    search.advance(6283.2);
    EXPECT_FALSE(search.found());
    EXPECT_GT(search.certified(), 6283.2);
    EXPECT_LT(search.expansions(), 10 * 1000);
  }
  for (const double damping : {0.1, 2.0, 50.0}) {
    model.C(0, 0) = damping;
    Problem problem(model);
    problem.enter({Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)}, 0.0);
    EventSearch search;
    const Watch watch{&problem.flow->gap(0), 1.0, 0, 0};
    search.begin(*problem.start, {&watch, 1});
    search.advance(1e9);
    EXPECT_FALSE(search.found()) << "damping " << damping;
    EXPECT_GT(search.certified(), 1e9) << "damping " << damping;
    EXPECT_LT(search.expansions(), 2000) << "damping " << damping;
  }
  // A pure decay towards zero never reaches it; the search ends at the least double.
  model.C(0, 0) = 2.0;
  model.contacts[0].clearance = 0.0;
  Problem problem(model);
  problem.enter({Eigen::VectorXd::Ones(1), Eigen::VectorXd::Zero(1)}, 0.0);
  EventSearch search;
  const Watch watch{&problem.flow->gap(0), 1.0, 0, 0};
  search.begin(*problem.start, {&watch, 1});
  search.advance(600.0);
  EXPECT_FALSE(search.found());
  EXPECT_GT(search.certified(), 600.0);
  search.advance(1e6);
  EXPECT_FALSE(search.found()) << "at " << search.tau();
  EXPECT_LT(search.expansions(), 5000);
}

TEST(EventSearch, RootDoesNotDependOnCallPattern) {
  int found = 0;
  for (int i = 0; i < repetitions(2000); ++i) {
    const std::uint64_t seed = 920000 + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    Problem problem = random_problem(random);
    shift_to(problem, problem.magnitude(*problem.start) * random.log_uniform(1e-3, 2.0));
    const Watch watch{&problem.signal, problem.sign, 0, 0};
    EventSearch once;
    once.begin(*problem.start, {&watch, 1});
    once.advance(3.0);
    EventSearch often;
    often.begin(*problem.start, {&watch, 1});
    double tau = 0.0;
    while (tau < 3.0) {
      tau = std::min(3.0, tau + random.log_uniform(1e-6, 1.0));
      often.advance(tau);
    }
    ASSERT_EQ(once.found(), often.found());
    ASSERT_EQ(once.certified(), often.certified());
    if (once.found()) {
      ASSERT_EQ(once.tau(), often.tau());
      ++found;
    }
    // A search can be reused.
    often.begin(*problem.start, {&watch, 1});
    often.advance(3.0);
    ASSERT_EQ(once.certified(), often.certified());
  }
  EXPECT_GT(found, repetitions(2000) / 3);
}

TEST(EventSearch, FirstOfSeveralWatchesTriggers) {
  for (int i = 0; i < repetitions(1000); ++i) {
    const std::uint64_t seed = 930000 + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    const Problem problem = random_problem(random);
    std::vector<Signal> signals;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Index f = problem.dynamics->coordinates();
      Functional functional = problem.dynamics->gap(0);
      functional.a = random.vector(f);
      functional.b = 0.1 * random.vector(f);
      Signal signal = problem.flow->signal(functional);
      const double shift = random.log_uniform(1e-2, 3.0) - value(signal, *problem.start);
      signal.constant += shift;
      signals.push_back(signal);
    }
    std::vector<Watch> watches;
    for (int k = 0; k < 4; ++k)
      watches.push_back({&signals[static_cast<std::size_t>(k)], 1.0, 0, k});
    EventSearch all;
    all.begin(*problem.start, watches);
    all.advance(2.0);
    double first = infinity;
    std::size_t winner = 4;
    for (std::size_t k = 0; k < 4; ++k) {
      EventSearch alone;
      alone.begin(*problem.start, {&watches[k], 1});
      alone.advance(2.0);
      if (alone.found() && alone.tau() < first) {
        first = alone.tau();
        winner = k;
      }
    }
    if (first > 2.0) {
      EXPECT_FALSE(all.found() && all.tau() <= 2.0);
      continue;
    }
    ASSERT_TRUE(all.found());
    EXPECT_NEAR(all.tau(), first, 1e-9);
    EXPECT_TRUE(all.fires(winner));
    int fired = 0;
    for (std::size_t k = 0; k < 4; ++k) fired += all.fires(k) ? 1 : 0;
    EXPECT_EQ(fired, 1);
    if (HasFailure()) return;
  }
}

TEST(EventSearch, SimultaneousWatchesAllTrigger) {
  for (int i = 0; i < repetitions(1000); ++i) {
    const std::uint64_t seed = 940000 + static_cast<std::uint64_t>(i);
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    Problem problem = random_problem(random);
    shift_to(problem, problem.magnitude(*problem.start) * random.log_uniform(1e-2, 0.5));
    // The same signal, its mirror image, a scaled one, and a later one.
    Signal mirror = problem.signal;
    mirror.p = -mirror.p;
    mirror.r = -mirror.r;
    mirror.constant = -mirror.constant;
    Signal scaled = problem.signal;
    const double factor = 3.7;
    scaled.p *= factor;
    scaled.r *= factor;
    scaled.constant *= factor;
    Signal later = problem.signal;
    later.constant += problem.sign * 0.01 * problem.magnitude(*problem.start);
    const std::vector<Watch> watches{{&problem.signal, problem.sign, 0, 0},
                                     {&mirror, -problem.sign, 0, 1},
                                     {&scaled, problem.sign, 0, 2},
                                     {&later, problem.sign, 0, 3}};
    EventSearch search;
    search.begin(*problem.start, watches);
    search.advance(2.0);
    if (!search.found()) continue;
    // The time of a root with almost zero slope is not accurate enough to be one instant.
    const double slope = std::abs(problem.slope(search.tau()));
    if (slope * 1e-13 < problem.rounding(search.tau())) continue;
    EXPECT_TRUE(search.fires(0));
    EXPECT_TRUE(search.fires(1));
    EXPECT_TRUE(search.fires(2));
    EXPECT_FALSE(search.fires(3));
    if (HasFailure()) return;
  }
}

TEST(EventSearch, FoundRootIsKeptUntilNextBegin) {
  Problem problem(ball(1.0, 0.0, 9.81));
  problem.enter({Eigen::VectorXd::Constant(1, 1.0), Eigen::VectorXd::Zero(1)}, 0.0);
  EventSearch search;
  const Watch watch{&problem.flow->gap(0), 1.0, 0, 0};
  search.begin(*problem.start, {&watch, 1});
  search.advance(10.0);
  ASSERT_TRUE(search.found());
  const double tau = search.tau();
  search.advance(100.0);
  EXPECT_EQ(search.tau(), tau);
  EXPECT_EQ(search.certified(), tau);
}

}  // namespace
}  // namespace sprag
