#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "sprag/detail/files/csv.h"
#include "studies/work_precision/measure.h"
#include "tests/support/repetitions.h"
#include "tests/support/run.h"

namespace sprag::work_precision {
namespace {

using test::shipped_scene;

Reference reference_of(const Scene& scene) {
  return reference(scene, SPRAG_SOURCE_DIR "/tests/reference");
}

const Method& method(const std::string& name) {
  for (const Method& candidate : methods()) {
    if (candidate.name == name) return candidate;
  }
  throw std::out_of_range("no method " + name);
}

const std::vector<ReferenceImpact> three{{1.0, -1.0}, {2.0, -1.0}, {3.0, -1.0}};

TEST(Impacts, ReportsErrorsOfAll) {
  const ImpactScore result = score(three, std::vector{1.01, 1.98, 3.04}, 4.0);
  EXPECT_EQ(result.found, 3);
  EXPECT_EQ(result.missed, 0);
  EXPECT_EQ(result.invented, 0);
  EXPECT_TRUE(std::isnan(result.first_missed));
  EXPECT_NEAR(result.median_dt, 0.02, 1e-12);
  EXPECT_NEAR(result.max_dt, 0.04, 1e-12);
}

TEST(Impacts, OutsideWindowCountsAsMissedAndSpurious) {
  const ImpactScore result = score(three, std::vector{1.0, 2.051, 3.0}, 4.0);
  EXPECT_EQ(result.found, 2);
  EXPECT_EQ(result.missed, 1);
  EXPECT_EQ(result.invented, 1);
  EXPECT_EQ(result.first_missed, 2.0);
  EXPECT_EQ(result.max_dt, 0.0);
}

TEST(Impacts, EachIsMatchedOnce) {
  const std::vector<ReferenceImpact> close{{1.0, -1.0}, {1.02, -1.0}};
  // 1.009 is nearer to the first, 1.011 to the second.
  const ImpactScore first = score(close, std::vector{1.009}, 2.0);
  EXPECT_EQ(first.found, 1);
  EXPECT_EQ(first.first_missed, 1.02);
  const ImpactScore second = score(close, std::vector{1.011}, 2.0);
  EXPECT_EQ(second.found, 1);
  EXPECT_EQ(second.first_missed, 1.0);
}

TEST(Impacts, NearestOfSeveralIsMatched) {
  const ImpactScore result = score(three, std::vector{0.97, 1.002, 1.03, 2.0, 3.0}, 4.0);
  EXPECT_EQ(result.found, 3);
  EXPECT_NEAR(result.max_dt, 0.002, 1e-12);
  EXPECT_EQ(result.invented, 2);  // 0.03 away from all impacts
}

TEST(Impacts, TailOfChatterIsOptional) {
  const std::vector<ReferenceImpact> chatter{{1.0, -1.0}, {1.1, -1e-3}, {1.11, -1e-5}};
  const ImpactScore without = score(chatter, std::vector{1.0, 1.1}, 2.0);
  EXPECT_EQ(without.found, 2);
  EXPECT_EQ(without.missed, 0);
  const ImpactScore with = score(chatter, std::vector{1.0, 1.1, 1.11, 1.114, 1.2}, 2.0);
  EXPECT_EQ(with.found, 2);
  EXPECT_EQ(with.invented, 1);
}

TEST(Impacts, AfterHorizonDoNotCount) {
  const ImpactScore result = score(three, std::vector{1.0, 2.5}, 1.5);
  EXPECT_EQ(result.found, 1);
  EXPECT_EQ(result.missed, 0);
  EXPECT_EQ(result.invented, 0);
}

TEST(Impacts, AllMissedWithoutResult) {
  const ImpactScore result = score(three, std::vector<double>{}, 4.0);
  EXPECT_EQ(result.missed, 3);
  EXPECT_EQ(result.first_missed, 1.0);
  EXPECT_TRUE(std::isnan(result.median_dt));
}

TEST(States, ErrorsExcludeImpactsAndUnreachedSamples) {
  Reference reference;
  reference.horizon = 2.0;
  reference.impacts = {{1.0005, -1.0}};
  reference.q = Eigen::MatrixXd::Zero(1, 5);
  reference.u = Eigen::MatrixXd::Zero(1, 5);
  Eigen::MatrixXd q{{0.0, 0.001, 0.002, 0.02, not_known}};
  Eigen::MatrixXd u{{0.0, 0.3, 100.0, 0.6, not_known}};
  const StateScore result = score(reference, q, u, 2.0);
  EXPECT_EQ(result.sup_q, 0.02);
  EXPECT_NEAR(result.l1_u, 0.3, 1e-15);
  EXPECT_EQ(result.horizon, 1.5);
  q(0, 3) = u(0, 3) = not_known;
  EXPECT_EQ(score(reference, q, u, 2.0).horizon, 1.5);
  EXPECT_EQ(score(reference, q, u, 1.0).sup_q, 0.002);
  EXPECT_EQ(score(reference, q, u, 1.0).horizon, 1.0);
}

TEST(BouncingMass, MasterMatchesClosedForm) {
  const Scene scene = shipped_scene("bouncing_ball");
  const Reference exact = bouncing_mass(scene.model, scene.truth.start, 20.0, 0.01);
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  Eigen::VectorXd q(1), u(1);
  for (Eigen::Index k = 0; k < exact.q.cols(); ++k) {
    const double t = static_cast<double>(k) * exact.sample_step;
    master.advance(at(t), events);
    master.state(at(t), q, u);
    EXPECT_NEAR(q[0], exact.q(0, k), 1e-9) << t;
    EXPECT_NEAR(u[0], exact.u(0, k), 1e-9) << t;
  }
  std::size_t k = 0;
  for (; k < events.size() && events[k].kind == ContactEventKind::pulse; ++k) {
    ASSERT_LT(k, exact.impacts.size());
    EXPECT_NEAR(events[k].t, exact.impacts[k].t, 1e-9);
  }
  EXPECT_GT(k, 100U);
  ASSERT_EQ(k + 1, events.size());
  EXPECT_EQ(events[k].kind, ContactEventKind::closes);
  EXPECT_NEAR(events[k].t, exact.impacts.back().t, 1e-9);
}

TEST(BouncingMass, AnotherMachineIsRefused) {
  const Scene scene = shipped_scene("paper_beam");
  EXPECT_THROW(bouncing_mass(scene.model, scene.truth.start, 1.0, 0.1), ModelError);
}

TEST(References, AllAreReadAndMatchTheirScenes) {
  for (const std::string& name : reference_scenes()) {
    const Scene scene = shipped_scene(name);
    const Reference reference = reference_of(scene);
    EXPECT_GE(reference.impacts.size(), 30U) << name;
    EXPECT_EQ(reference.q.rows(), scene.model.coordinates());
    EXPECT_EQ(reference.q.cols(), static_cast<Eigen::Index>(2 * reference.horizon) + 1) << name;
    EXPECT_TRUE(reference.q.allFinite() && reference.u.allFinite()) << name;
  }
  Scene other = shipped_scene("paper_beam");
  other.name = "unknown";
  EXPECT_THROW(reference_of(other), InputError);
}

void dies(const Task&, double, Outcome&) { std::raise(SIGKILL); }
void leaves(const Task&, double, Outcome&) {
  std::fputs("first words\nlast words\n", stderr);
  std::exit(7);
}
void hangs(const Task&, double, Outcome&) {
  for (;;) pause();
}
void throws(const Task&, double, Outcome&) { throw std::runtime_error("no idea"); }
void fails(const Task& task, double, Outcome& outcome) {
  outcome.q.leftCols(1).setConstant(task.start.q[0]);
  outcome.u.leftCols(1).setZero();
  outcome.steps = 5;
  outcome.impacts = {std::sqrt(2 * 0.9 / 9.81)};
  outcome.failure = "gave up";
}
void dies_without_samples(const Task& task, double setting, Outcome& outcome) {
  if (task.sample_step == 0.0) std::raise(SIGKILL);
  methods().front().run(task, setting, outcome);
}
void holds_memory(const Task& task, double, Outcome& outcome) {
  constexpr std::size_t megabytes = 20;
  std::vector<unsigned char> memory(megabytes << 20, 1);
  outcome.steps = memory[static_cast<std::size_t>(task.horizon)];
}

Measurement measured(void (*run)(const Task&, double, Outcome&), double timeout = 60.0) {
  const Scene scene = shipped_scene("bouncing_ball");
  const Method made{"made up", Kind::rival, "none", {0.0}, run};
  return measure(made, 0.0, scene.model, scene.truth.start, reference_of(scene),
                 {.timeout = timeout, .timing = 0.01});
}

TEST(Children, KilledChildIsAFailure) { EXPECT_EQ(measured(dies).failure, "signal: Killed"); }

TEST(Children, ExitingChildIsAFailureWithItsLastLine) {
  EXPECT_EQ(measured(leaves).failure, "exit with 7; last words");
}

TEST(Children, HangingChildIsKilled) {
  const Measurement result = measured(hangs, 0.2);
  EXPECT_EQ(result.failure, "timeout after 0.2 s");
  EXPECT_EQ(result.figures.impacts.found, 0);
  EXPECT_EQ(result.figures.impacts.missed, 102);
}

TEST(Children, ThrowingChildIsAFailure) {
  EXPECT_EQ(measured(throws).failure, "exception: no idea");
}

TEST(Children, FailureKeepsPartialResults) {
  const Measurement result = measured(fails);
  EXPECT_EQ(result.failure, "gave up");
  EXPECT_EQ(result.figures.steps, 5);
  EXPECT_EQ(result.figures.impacts.found, 1);
  EXPECT_GT(result.figures.impacts.missed, 90);
  EXPECT_EQ(result.figures.states.sup_q, 0.0);
  EXPECT_EQ(result.figures.states.horizon, 0.5);
  EXPECT_TRUE(std::isnan(result.figures.cpu_us_per_time));
}

TEST(Children, CrashKeepsFiguresOfEarlierRuns) {
  const Measurement result = measured(dies_without_samples);
  EXPECT_EQ(result.failure, "signal: Killed");
  EXPECT_GT(result.figures.impacts.found, 90);
  EXPECT_EQ(result.figures.states.horizon, 20.0);
}

TEST(Children, MemoryIsIncreaseDuringRun) {
  if (sanitized) GTEST_SKIP() << "a sanitizer keeps memory of its own";
  const Measurement result = measured(holds_memory);
  EXPECT_TRUE(result.failure.empty()) << result.failure;
  if (std::isnan(result.figures.memory_kb)) GTEST_SKIP() << "no /proc/self/clear_refs here";
  EXPECT_NEAR(result.figures.memory_kb, 20 * 1024, 1024);
}

TEST(WorkPrecision, TheExactMethodFindsAllImpactsOfThePaperBeam) {
  const Scene scene = shipped_scene("paper_beam");
  const Measurement result = measure(method("exact"), 0.0, scene.model, scene.truth.start,
                                     reference_of(scene), {.timing = 0.01});
  EXPECT_EQ(result.failure, "");
  EXPECT_EQ(result.figures.impacts.found, 33);
  EXPECT_EQ(result.figures.impacts.missed, 0);
  EXPECT_EQ(result.figures.impacts.invented, 0);
  EXPECT_LE(result.figures.impacts.max_dt, 1e-11);
  EXPECT_EQ(result.figures.states.horizon, 20.0);
  EXPECT_LE(result.figures.states.sup_q, 1e-10);
  EXPECT_LE(result.figures.penetration, 1e-12);
  EXPECT_GT(result.figures.cpu_us_per_time, 0.0);
}

}  // namespace
}  // namespace sprag::work_precision
