// Identification of drawn records (studies/identification): would catch wrong values, sigmas that
// claim too much or too little, unfound errors of the record, and wrong verdicts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "sprag/detail/identification/gauss_newton.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/identification.h"
#include "studies/common/random.h"
#include "studies/identification/records.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

using identification_study::drawn;
using identification_study::error_of;
using identification_study::Record;

Identification fitted(const Record& record) {
  return identify(record.nominal, record.events, record.settings);
}

bool claims(const Identification& result) {
  return result.fits() && std::any_of(result.unknowns.begin(), result.unknowns.end(),
                                      [](const FittedUnknown& of) { return of.determined; });
}

// Errors of the determined values in their sigmas; 0 for rounding errors.
std::vector<double> errors(const Record& record, const Identification& result) {
  std::vector<double> all;
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    const FittedUnknown& of = result.unknowns[k];
    if (!of.determined || std::isnan(record.truth[k])) continue;
    const double error = std::abs(error_of(of.unknown, of.value, record.truth[k]));
    const double sigma = of.sigma / std::abs(of.unknown.slope(of.value));
    all.push_back(error < 1e-7 ? 0.0 : error / sigma);
  }
  return all;
}

void expect_triangularized(Eigen::MatrixXd M) {
  const Eigen::MatrixXd before = product(M.transpose(), M);
  triangularize_rows(M);
  EXPECT_LT((product(M.transpose(), M) - before).norm(), 1e-13 * before.trace());
  EXPECT_EQ(M.triangularView<Eigen::StrictlyLower>().toDenseMatrix().norm(), 0.0);
}

TEST(DrawnRecords, TriangularizationKeepsTheProductOfColumns) {
  common::Random draw(1);
  Eigen::MatrixXd M(7, 5);
  for (double& entry : M.reshaped()) entry = draw.normal();
  expect_triangularized(M);
}

TEST(DrawnRecords, TriangularizationOfAnotherRowKeepsTheProductOfColumns) {
  common::Random draw(2);
  Eigen::MatrixXd M(7, 6);
  for (double& entry : M.reshaped()) entry = draw.normal();
  M.bottomRows(6) = M.bottomRows(6).triangularView<Eigen::Upper>().toDenseMatrix();
  M.col(2).setZero();
  expect_triangularized(M);
}

// Along the recorded times a path moves linearly with its start, unless a restitution depends on
// the speed: then it is flown again. So small a slope changes nothing else.
TEST(DrawnRecords, HeldPathsMoveLinearlyWithTheirStart) {
  for (const char* kind : {"beam, 7", "two masses", "plastic impacts", "all contacts last"}) {
    const Record record = drawn(kind, 1);
    Scene curved = record.nominal;
    for (Contact& contact : curved.model.contacts) contact.curve.slope = -1e-200;
    std::vector<GaussNewton::Held> held;
    for (const Scene& scene : {record.nominal, curved}) {
      GaussNewton solver(scene, record.settings.unknowns, false);
      const Eigen::VectorXd c = Eigen::VectorXd::Zero(solver.parameters());
      solver.resolve(1e-8);
      solver.flight().set(c, false);
      const FitRecord of = fit_record(record.events, record.settings, 0.0, solver.flight());
      held.push_back(solver.hold({of.stretches.front().part(0, 16)}, c, 2));
    }
    EXPECT_NEAR(held[0].rms, held[1].rms, 1e-5 * held[1].rms) << kind;
    EXPECT_NEAR(held[0].score, held[1].score, 1e-5 * held[1].score) << kind;
    EXPECT_LT((held[0].c - held[1].c).norm(), 1e-5) << kind;
    EXPECT_LT((held[0].starts[0] - held[1].starts[0]).norm(), 1e-5 * held[1].starts[0].norm())
        << kind;
  }
}

// Trial number `trial` of a kind has exact times if `trial` is a multiple of 3.
struct Trials {
  const char* kind;
  int count;
  std::size_t missing = 0, spurious = 0;  ///< events that are reported as such
};

TEST(DrawnRecords, FindsTheValuesOfRightMachines) {
  for (const Trials& of :
       {Trials{"beam, 3", 3}, Trials{"rattle", 3}, Trials{"oscillator", 3},
        Trials{"near resonance", 3}, Trials{"ball, drag", 3}, Trials{"no scale", 6},
        Trials{"slope sought", 9}, Trials{"plastic impacts", 2}, Trials{"two masses", 2},
        Trials{"one lost", 2, 1}, Trials{"one spurious", 2, 0, 1}}) {
    for (int trial = 0; trial < of.count; ++trial) {
      SCOPED_TRACE(testing::Message() << of.kind << ' ' << trial);
      const Record record = drawn(of.kind, static_cast<std::uint64_t>(trial));
      const Identification result = fitted(record);
      EXPECT_TRUE(result.fits()) << reason_of(result);
      for (const double z : errors(record, result)) EXPECT_LT(z, 6.0);
      EXPECT_EQ(result.missing.size(), of.missing);
      EXPECT_EQ(result.spurious.size(), of.spurious);
      EXPECT_GE(result.used_share(), 0.9);
      if (of.kind == std::string("no scale")) {  // nor is the motion zero
        EXPECT_GT(result.start.q.norm() + result.start.u.norm(), 1e-3);
      }
    }
  }
}

// Machines outside of the family: refused, or nothing is claimed.
TEST(DrawnRecords, RefusesOtherMachines) {
  for (const Trials& of :
       {Trials{"clock 1 %", thorough() ? 2 : 1}, Trials{"restitution by speed", 3}}) {
    for (int trial = 0; trial < of.count; ++trial) {
      const Identification result = fitted(drawn(of.kind, static_cast<std::uint64_t>(trial)));
      EXPECT_FALSE(claims(result)) << of.kind << ' ' << trial << ", scatter " << result.scatter;
    }
  }
}

TEST(DrawnRecords, ExactTimesGiveExactValues) {
  const Record record = drawn("beam, 7", 0);
  ASSERT_EQ(record.jitter, 0.0);
  const Identification result = fitted(record);
  ASSERT_TRUE(result.fits());
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    const FittedUnknown& of = result.unknowns[k];
    EXPECT_LT(std::abs(error_of(of.unknown, of.value, record.truth[k])), 1e-8) << of.unknown.key;
  }
}

// For any given jitter: an interval near a multiple of its neighbours lacks an impact.
TEST(DrawnRecords, FindsLostBounces) {
  int found = 0;
  for (std::uint64_t trial = 0; trial < 9; trial += 2) {
    Record record = drawn("ball, lost bounces", trial);
    for (const double factor : {1.0, 10.0}) {
      if (record.settings.jitter) *record.settings.jitter *= factor;
      const Identification result = fitted(record);
      ASSERT_TRUE(result.fits()) << trial;
      for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
      found += result.missing.size() == 1 && result.spurious.empty();
    }
  }
  EXPECT_EQ(found, 10);
}

// An event off by many jitters is not explained by moving it.
TEST(DrawnRecords, EventIsNotRepairedByMovingIt) {
  Record record = drawn("ball, drag", 1);
  record.settings.jitter = record.jitter;
  record.events[record.events.size() / 2].t += 60.0 * record.jitter;
  EXPECT_EQ(fitted(record).problem, FitProblem::lost_or_spurious_events);
}

// An impact is lost, and one or two events later another one is spurious.
TEST(DrawnRecords, FindsNeighbouringErrorsOfTheRecord) {
  int found = 0;
  for (std::uint64_t trial = 0; trial < 5; ++trial) {
    Record record = drawn("oscillator", trial);
    std::vector<ContactEvent>& events = record.events;
    const std::size_t lost = 12 + 3 * trial;
    ASSERT_LT(lost + 8, events.size());
    const std::size_t after = lost + 1 + trial % 2;
    const double t = 0.4 * events[after].t + 0.6 * events[after + 1].t;
    events.insert(events.begin() + static_cast<std::ptrdiff_t>(after) + 1,
                  {t, 0, ContactEventKind::pulse});
    events.erase(events.begin() + static_cast<std::ptrdiff_t>(lost));
    const Identification result = fitted(record);
    if (!result.fits()) continue;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
    found += result.missing.size() == 1 && result.spurious == std::vector{after};
  }
  std::cout << found << " of 5 found\n";
  EXPECT_GE(found, 4);
}

// Valleys of the cost are curved where a parameter is weakly determined.
TEST(DrawnRecords, ExactTimesOfWhichSomeAreLostGiveTheMachine) {
  for (std::uint64_t trial = 0; trial < 12; trial += 3) {
    const Record record = drawn("two lost", trial);
    ASSERT_EQ(record.jitter, 0.0);
    const Identification result = fitted(record);
    EXPECT_TRUE(result.fits()) << trial;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
  }
}

// The comparison with the path does not find the event; its residual in the fit of all events does.
TEST(DrawnRecords, FindsASpuriousEventByItsResidual) {
  const Record record = drawn("one spurious", 5);
  const Identification result = fitted(record);
  EXPECT_TRUE(result.fits()) << reason_of(result);
  EXPECT_EQ(result.spurious.size(), 1U);
  for (const double z : errors(record, result)) EXPECT_LT(z, 6.0);
}

// A spurious event is among the few that tell about the machine; the rest is a settled orbit.
TEST(DrawnRecords, FindsErrorsOfTheTransient) {
  for (const std::uint64_t trial : {33U, 45U}) {
    const Record record = drawn("2 lost, 2 spurious", trial);
    ASSERT_EQ(record.jitter, 0.0);
    const Identification result = fitted(record);
    EXPECT_TRUE(result.fits()) << trial << ": " << reason_of(result);
    EXPECT_EQ(result.missing.size(), 2U) << trial;
    EXPECT_EQ(result.spurious.size(), 2U) << trial;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
  }
}

// One or two times a period determine no three values, whatever their jitter. Exact times keep the
// last of the transient.
TEST(DrawnRecords, ClaimsNothingFromALockedOrbit) {
  int claimed = 0;
  for (std::uint64_t trial = 0; trial < 12; ++trial) {
    const Record record = drawn("locked orbit", trial);
    const Identification result = fitted(record);
    claimed += claims(result);
    EXPECT_TRUE(record.jitter == 0.0 || !claims(result)) << trial;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
  }
  EXPECT_LE(claimed, 2);
}

// One pulse among contacts that last: only a restitution that changes by thousands would move it.
TEST(DrawnRecords, NamesNoCauseOfAnImpossibleSize) {
  for (const std::uint64_t trial : {16U, 43U, 44U}) {
    const Record record = drawn("plastic impacts", trial);
    const Identification result = fitted(record);
    EXPECT_TRUE(result.fits()) << trial << ": " << reason_of(result);
    EXPECT_EQ(result.departure.cause, Cause::none) << trial;
    const auto& trend = result.departure.trend;
    EXPECT_FALSE(trend && std::abs(trend->trend) > 100.0) << trial << ": " << trend->trend;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
  }
}

// A wrong machine is not explained by events that would be spurious.
TEST(DrawnRecords, DoesNotBlameTheRecordForFriction) {
  for (const std::uint64_t trial : {6U, 9U, 12U}) {
    EXPECT_EQ(fitted(drawn("friction", trial)).problem, FitProblem::wrong_model) << trial;
  }
}

// In these records another minimum of the cost explains all events as well.
TEST(DrawnRecords, ClaimsNoValueThatAnotherMinimumContradicts) {
  for (const char* kind : {"all contacts last", "2 lost, 2 spurious"}) {
    const Record record = drawn(kind, 9);
    ASSERT_EQ(record.jitter, 0.0);
    for (const double z : errors(record, fitted(record))) EXPECT_LT(z, 6.0) << kind;
  }
}

TEST(DrawnRecords, SigmasAreCalibrated) {
  double squares = 0.0;
  int values = 0;
  for (std::uint64_t trial = 0; trial < static_cast<std::uint64_t>(repetitions(60)); ++trial) {
    const Record record = drawn("ball, drag", trial);
    if (record.jitter == 0.0) continue;
    const Identification result = fitted(record);
    EXPECT_TRUE(result.fits()) << trial;
    for (const double z : errors(record, result)) squares += z * z, ++values;
  }
  std::cout << "mean square " << squares / values << " of " << values << " values\n";
  if (values < 50) return;
  EXPECT_GT(squares, 0.6 * values);
  EXPECT_LT(squares, 1.7 * values);
}

// A restitution that is held 3 % off its value: refused, or within the sigmas of the other values.
TEST(DrawnRecords, RefusesAWrongValueThatIsNotFree) {
  int refused = 0;
  for (const std::uint64_t trial : {1U, 2U, 4U, 5U}) {
    Record record = drawn("rattle", trial);
    for (Contact& contact : record.nominal.model.contacts) {
      contact.restitution = 0.97 * record.truth.front();
    }
    ASSERT_EQ(record.settings.unknowns.front().key, "impact.restitution");
    record.settings.unknowns.erase(record.settings.unknowns.begin());
    record.truth.erase(record.truth.begin());
    const Identification result = fitted(record);
    refused += !result.fits();
    if (!result.fits()) continue;
    for (const double z : errors(record, result)) EXPECT_LT(z, 6.0) << trial;
  }
  EXPECT_GE(refused, 3);
}

TEST(DrawnRecords, StopsOnRequest) {
  const Record record = drawn("beam, 3", 0);
  std::stop_source source;
  source.request_stop();
  EXPECT_THROW(identify(record.nominal, record.events, record.settings, source.get_token()),
               Interrupted);
}

}  // namespace
}  // namespace sprag
