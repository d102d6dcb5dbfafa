// Would catch a clock jump that is followed at once or never.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "recording/session_tracker.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

/// A master with a heartbeat of 10 ms.
class ContinuityTest : public ::testing::Test {
 protected:
  using Verdict = Continuity::Verdict;

  ContactMessage next() {
    ContactMessage report;
    report.sequence = ++number_;
    report.records_total = number_ / 10;
    report.speed = speed_;
    monotonic_ += 10'000'000;
    report.horizon = t_ += 0.01 * speed_;
    return report;
  }
  Verdict receive(const ContactMessage& report) {
    return continuity_.receive(report, {monotonic_, monotonic_ / 1000});
  }
  Verdict receive_next() { return receive(next()); }
  void start(int messages) {
    continuity_.restart(next(), {monotonic_, 0});
    for (int i = 0; i < messages; ++i) EXPECT_EQ(receive_next(), Verdict::fits);
  }
  /// Messages until one is followed, and its verdict.
  int refused(Verdict& last) {
    int count = 0;
    while ((last = receive_next()) == Verdict::odd && count < 100) ++count;
    return count;
  }

  Continuity continuity_{1e-3};
  std::int64_t number_ = 0, monotonic_ = 5'000'000'000;
  double t_ = 0.0, speed_ = 2.0;
};

using Spoil = std::function<void(ContactMessage&)>;

TEST_F(ContinuityTest, OneImplausibleMessageIsRefusedAndNextAccepted) {
  for (const auto& [spoil, oddity] : std::initializer_list<std::pair<Spoil, Oddity>>{
           {[](ContactMessage& r) { r.horizon += 30.0; }, Oddity::time},
           {[](ContactMessage& r) { r.horizon = 1e300; }, Oddity::time},
           {[](ContactMessage& r) { r.horizon = 0.0; }, Oddity::time},
           {[](ContactMessage& r) { r.speed = 1e300; }, Oddity::speed},
           {[](ContactMessage& r) { r.speed = infinity; }, Oddity::speed},
           {[](ContactMessage& r) { r.sequence = std::int64_t{1} << 53; }, Oddity::number},
           {[](ContactMessage& r) { r.records_total = std::int64_t{1} << 53; }, Oddity::records},
           {[](ContactMessage& r) { r.records_total = 0; }, Oddity::records}}) {
    start(2000);
    ContactMessage odd = next();
    spoil(odd);
    EXPECT_EQ(receive(odd), Verdict::odd);
    EXPECT_EQ(continuity_.oddity(), oddity);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(receive_next(), Verdict::fits);
  }
}

TEST_F(ContinuityTest, ImpossibleContentIsRefused) {
  ContactMessage report = next();
  EXPECT_EQ(continuity_.impossible(report), Oddity::none);
  report.speed = infinity;
  report.horizon = 1.7e9;  // seconds since 1970
  EXPECT_EQ(continuity_.impossible(report), Oddity::none);
  report.horizon = 1e13;
  EXPECT_EQ(continuity_.impossible(report), Oddity::time);
  report = next();
  report.speed = 1e300;
  EXPECT_EQ(continuity_.impossible(report), Oddity::speed);
  report = next();
  report.sequence = std::int64_t{1} << 53;
  EXPECT_EQ(continuity_.impossible(report), Oddity::number);
  report = next();
  report.records_total = std::int64_t{1} << 53;
  EXPECT_EQ(continuity_.impossible(report), Oddity::records);
}

// A step back of less than half a second is waited for; a longer one is followed, as a suspension
// of the host is, in which messages are lost.
TEST_F(ContinuityTest, ClockStepIsFollowedAtThirdMessage) {
  for (const auto& [step, lost] : std::initializer_list<std::pair<double, std::int64_t>>{
           {25.0, 0}, {1e7, 0}, {-25.0, 0}, {-1e6, 0}, {-6.0, 0}, {-2.0, 0}, {7200.0, 360'000}}) {
    t_ = 2e6;
    start(200);
    t_ += step;
    number_ += lost;
    Verdict last;
    EXPECT_EQ(refused(last), 2) << step;
    EXPECT_EQ(last, Verdict::resumes);
    EXPECT_EQ(continuity_.oddity(), Oddity::time);
    for (int i = 0; i < 100; ++i) EXPECT_EQ(receive_next(), Verdict::fits);
  }
  t_ -= 0.2 * speed_;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(receive_next(), Verdict::fits);
}

TEST_F(ContinuityTest, LaterMessagesAreFollowedAfterImplausibleFirstOne) {
  for (const Spoil& spoil : std::initializer_list<Spoil>{
           [](ContactMessage& r) { r.horizon = 1e6; },
           [](ContactMessage& r) { r.sequence = std::int64_t{1} << 51; },
           [](ContactMessage& r) { r.records_total = std::int64_t{1} << 51; },
           [](ContactMessage& r) { r.speed = infinity; },
           [](ContactMessage& r) {
             r.horizon = 1e6;
             r.sequence = r.records_total = std::int64_t{1} << 51;
           }}) {
    ContactMessage first = next();
    spoil(first);
    continuity_.restart(first, {monotonic_, 0});
    Verdict last;
    EXPECT_EQ(refused(last), 2);
    EXPECT_EQ(last, Verdict::resumes);
    EXPECT_EQ(receive_next(), Verdict::fits);
  }
}

TEST_F(ContinuityTest, ConstantNumberIsNeverFollowed) {
  start(10);
  for (int i = 0; i < 100; ++i) {
    number_ = 11;
    const Verdict verdict = receive_next();
    EXPECT_EQ(verdict, i == 0 ? Verdict::fits : Verdict::odd);
    EXPECT_EQ(continuity_.oddity(), i == 0 ? Oddity::none : Oddity::number);
  }
}

TEST_F(ContinuityTest, LateDuplicateAndLostMessagesAreAccepted) {
  start(100);
  const ContactMessage late = next();
  for (int i = 0; i < 50; ++i) EXPECT_EQ(receive_next(), Verdict::fits);
  EXPECT_EQ(receive(late), Verdict::fits);
  EXPECT_EQ(receive(late), Verdict::fits);
  for (int i = 0; i < 5000; ++i) (void)next();
  EXPECT_EQ(receive_next(), Verdict::fits);
}

TEST_F(ContinuityTest, PausedAndUnpacedMastersAreAccepted) {
  start(10);
  monotonic_ += 3600'000'000'000;  // stopped, and continues at the same time
  EXPECT_EQ(receive_next(), Verdict::fits);
  speed_ = infinity;
  t_ = 0.0;
  ContactMessage report = next();
  report.horizon = 1.0;
  continuity_.restart(report, {monotonic_, 0});
  for (double t = 2.0; t < 1e6; t *= 3.0) {
    report = next();
    report.horizon = t;
    EXPECT_EQ(receive(report), Verdict::fits);
  }
  report = next();
  report.horizon = 1.0;
  EXPECT_EQ(receive(report), Verdict::odd);
  EXPECT_EQ(continuity_.oddity(), Oddity::time);
}

}  // namespace
}  // namespace sprag
