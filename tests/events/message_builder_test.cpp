// Would catch reports that omit or renumber a record, or whose horizon and chi contradict their
// records.
#include "sprag/detail/events/message_builder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sprag/detail/events/event_history.h"
#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random_events.h"

namespace sprag {
namespace {

using enum ContactEventKind;

/// Reports of a master that polls its clock at intervals, with `burst` events per poll on average.
std::vector<ContactMessage> send(const std::vector<ContactEvent>& events, int contacts, int burst,
                                 Random& random) {
  MessageBuilder builder(42, 1.0, contacts);
  std::vector<ContactMessage> reports;
  std::span<const ContactEvent> rest(events);
  double horizon = 0.0;
  const double spacing = events.back().t / static_cast<double>(events.size());
  while (!rest.empty()) {
    horizon += random.uniform(0.0, 2.0) * burst * spacing;
    std::size_t count = 0;
    while (count < rest.size() && rest[count].t <= horizon) ++count;
    EXPECT_FALSE(builder.pending());
    builder.add(rest.first(count));
    rest = rest.subspan(count);
    EXPECT_EQ(builder.pending(), count > 0);
    do reports.push_back(builder.next(horizon, 1000 + builder.sent()));
    while (builder.pending());
    EXPECT_EQ(reports.back().horizon, horizon);
  }
  EXPECT_EQ(builder.sent(), static_cast<std::int64_t>(reports.size()));
  return reports;
}

class ReportBuilderTest : public ::testing::TestWithParam<int> {
 protected:
  /// Calls check(events, reports) for random runs.
  template <typename Check>
  void for_random_runs(Check&& check) {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      Random random(seed);
      const int contacts = seed % 4 == 0 ? max_contacts : random.integer(1, 5);
      const double from = seed % 3 == 0 ? 0.0 : 0.01;
      const auto events = random_events(random, contacts, 1000, from, 0.01);
      check(events, send(events, contacts, GetParam(), random));
    }
  }
};

// Records per poll: fewer and more than one report can carry.
INSTANTIATE_TEST_SUITE_P(Bursts, ReportBuilderTest, ::testing::Values(1, 50, 200, 2000));

// Every record is new once, with its number, and every report repeats the last records. A burst is
// split between instants; the horizon is between the last record and the next one.
TEST_P(ReportBuilderTest, ReportsCarryEveryRecordInOrder) {
  for_random_runs([](const auto& events, const auto& reports) {
    std::int64_t sent = 0;
    double horizon = 0.0;
    for (std::size_t i = 0; i < reports.size(); ++i) {
      const ContactMessage& report = reports[i];
      ASSERT_EQ(report.sequence, reports[0].sequence + static_cast<std::int64_t>(i));
      ASSERT_EQ(report.utime, reports[0].utime + static_cast<std::int64_t>(i));
      ASSERT_EQ(report.session, 42);
      ASSERT_EQ(report.speed, 1.0);
      ASSERT_GE(report.records_total, sent);
      ASSERT_LE(report.records_total - sent, report.records) << "a new record is not carried";
      ASSERT_EQ(report.records, std::min<std::int64_t>(report.records_total, max_records));
      const auto next = static_cast<std::size_t>(report.records_total);
      ASSERT_TRUE(std::equal(report.record.begin(), report.record.begin() + report.records,
                             events.begin() + static_cast<std::ptrdiff_t>(next) - report.records));
      ASSERT_EQ(report.closed, chi_after(events, next));
      ASSERT_GE(report.horizon, horizon) << "never goes back";
      if (next > 0) {
        ASSERT_GE(report.horizon, events[next - 1].t);
      }
      if (next < events.size()) {
        ASSERT_LT(report.horizon, events[next].t);
      }
      sent = report.records_total;
      horizon = report.horizon;
    }
    EXPECT_EQ(sent, static_cast<std::int64_t>(events.size()));
  });
}

TEST_P(ReportBuilderTest, EventHistoryRestoresTheEvents) {
  for_random_runs([](const auto& events, const auto& reports) {
    EventHistory history(max_contacts, events.size());
    history.restart(0, 0, no_horizon);
    for (const ContactMessage& report : reports) history.add(report);
    EXPECT_EQ(history.events(), events);
    EXPECT_EQ(history.counts().events, static_cast<std::int64_t>(events.size()));
    EXPECT_EQ(history.counts().lost_records, 0);
    EXPECT_TRUE(history.degraded().empty());
  });
}

TEST(MessageBuilder, HeartbeatHasNoNewRecords) {
  MessageBuilder builder(1, infinity, 2);
  EXPECT_FALSE(builder.pending());
  const ContactMessage first = builder.next(0.5, 10);
  EXPECT_EQ(first.records, 0);
  EXPECT_EQ(first.records_total, 0);
  EXPECT_EQ(first.horizon, 0.5);
  EXPECT_EQ(first.contacts, 2);
  EXPECT_EQ(first.speed, infinity);
  builder.add(std::vector<ContactEvent>{{0.75, 1, closes}});
  EXPECT_TRUE(builder.pending());
  const ContactMessage second = builder.next(1.0, 20);
  const ContactMessage third = builder.next(2.0, 30);
  EXPECT_FALSE(builder.pending());
  EXPECT_EQ(third.records_total, second.records_total);
  EXPECT_EQ(third.records, second.records);
  EXPECT_EQ(third.closed, 2U);
  EXPECT_EQ(third.horizon, 2.0);
  EXPECT_EQ(third.utime, 30);
  EXPECT_EQ(third.sequence, first.sequence + 2);
}

TEST(MessageBuilder, ExactlyFullReportIsNotSplit) {
  std::vector<ContactEvent> events;
  for (int i = 0; i < max_records; ++i) events.push_back({0.01 * (i + 1), 0, pulse});
  MessageBuilder builder(1, 1.0, 1);
  builder.add(events);
  EXPECT_EQ(builder.next(5.0, 0).records_total, max_records);
  EXPECT_FALSE(builder.pending());
  builder.add(std::vector<ContactEvent>{{6.0, 0, pulse}});
  const ContactMessage& next = builder.next(7.0, 0);
  EXPECT_EQ(next.records, max_records);
  EXPECT_EQ(next.records_total, max_records + 1);
  EXPECT_EQ(next.record[0], events[1]);
}

}  // namespace
}  // namespace sprag
