// Would catch a history that loses, repeats or reorders records, reads a report wrongly after a
// gap, or admits an event before a time that it has declared complete.
#include "sprag/detail/events/event_history.h"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <utility>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random_events.h"
#include "tests/support/recorded_run.h"

namespace sprag {
namespace {

using enum ContactEventKind;

using Events = std::vector<ContactEvent>;

EventHistory started(int contacts = 2) {
  EventHistory history(contacts, 1000);
  history.restart(0, 0, no_horizon);
  return history;
}

ContactMessage report_of(const Events& records, std::int64_t total, double horizon,
                         ContactSet closed) {
  ContactMessage report;
  report.contacts = 2;
  report.records = static_cast<int>(records.size());
  std::copy(records.begin(), records.end(), report.record.begin());
  report.records_total = total;
  report.horizon = horizon;
  report.closed = closed;
  return report;
}

/// chi after the events of a history, from `chi` before its first event.
ContactSet chi_of(const EventHistory& history, ContactSet chi = 0) {
  for (const ContactEvent& event : history.events()) chi = after(chi, event);
  return chi;
}

TEST(EventHistory, TakesEveryRecordOnceDespiteLossDuplicationAndReordering) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Events events = random_events(random, 2, 300, 0.0, 0.01);
    auto reports = reports_at(event_and_heartbeat_times(events, 0.005, events.back().t), events, 2);
    EventHistory history = started();
    std::size_t appended = 0;
    std::size_t i = 0;
    while (i < reports.size()) {
      const auto back = static_cast<std::size_t>(random.integer(0, 20));
      appended += history.add(reports[i - std::min(i, back)]);
      if (random.chance(0.5)) appended += history.add(reports[i]);
      i += static_cast<std::size_t>(random.integer(1, 8));
    }
    appended += history.add(reports.back());
    EXPECT_EQ(history.events(), events);
    EXPECT_EQ(appended, events.size());
    EXPECT_EQ(history.counts().events, static_cast<std::int64_t>(events.size()));
    EXPECT_EQ(history.counts().lost_records, 0);
    EXPECT_EQ(history.counts().of(Skip::backwards), 0);
    EXPECT_EQ(history.counts().of(Skip::contradicting), 0);
    EXPECT_TRUE(history.degraded().empty());
    EXPECT_EQ(history.horizon(), reports.back().horizon);
  }
}

TEST(EventHistory, DetectsLostRecordsBeforeGivenTime) {
  EventHistory history = started();
  history.add(report_of({{1.0, 0, pulse}}, 1, 1.5, 0));
  EXPECT_FALSE(history.lost_before(1.0, 4));
  // Records 2 to 9 are lost.
  history.add(report_of({{5.0, 0, pulse}, {6.0, 0, pulse}, {7.0, 0, pulse}}, 12, 8.0, 0));
  EXPECT_FALSE(history.lost_before(1.2, 4)) << "before the gap";
  EXPECT_TRUE(history.lost_before(1.5, 0)) << "at its begin";
  EXPECT_TRUE(history.lost_before(3.0, 0)) << "within the gap";
  EXPECT_TRUE(history.lost_before(5.0, 0)) << "the event that ends it";
  EXPECT_FALSE(history.lost_before(6.0, 0));
  EXPECT_TRUE(history.lost_before(6.0, 1));
  EXPECT_TRUE(history.lost_before(7.0, 2));
  EXPECT_FALSE(history.lost_before(7.0, 1));
  // A second gap, soon after.
  history.add(report_of({{20.0, 0, pulse}}, 30, 20.0, 0));
  EXPECT_TRUE(history.lost_before(20.0, 0));
  EXPECT_FALSE(history.lost_before(7.0, 1));
  history.restart(30, 0, 20.0);
  EXPECT_FALSE(history.lost_before(21.0, 100)) << "a new start has lost nothing";
}

TEST(EventHistory, HorizonNeverDecreases) {
  EventHistory history = started();
  history.set_horizon(2.0);
  history.set_horizon(1.0);
  EXPECT_EQ(history.horizon(), 2.0);
  history.add(report_of({}, 0, 1.5, 0));
  EXPECT_EQ(history.horizon(), 2.0);
}

TEST(EventHistory, AGapIsCountedAndItsIntervalRecorded) {
  EventHistory history = started();
  history.add(report_of({{1.0, 0, pulse}}, 1, 1.5, 0));
  EXPECT_EQ(history.add(report_of({{4.0, 0, pulse}, {5.0, 1, pulse}}, 8, 6.0, 0)), 2U);
  EXPECT_EQ(history.counts().lost_records, 5);
  EXPECT_EQ(history.counts().made_up, 0);
  ASSERT_EQ(history.degraded().size(), 1U);
  EXPECT_EQ(history.degraded()[0].from, 1.5);
  EXPECT_EQ(history.degraded()[0].to, 4.0);
  EXPECT_EQ(history.events(), (Events{{1.0, 0, pulse}, {4.0, 0, pulse}, {5.0, 1, pulse}}));
  EXPECT_EQ(history.horizon(), 6.0);
  // The next report repeats the last records.
  history.add(report_of({{5.0, 1, pulse}, {7.0, 1, pulse}}, 9, 7.0, 0));
  EXPECT_EQ(history.counts().lost_records, 5);
  EXPECT_EQ(history.events().size(), 4U);
  EXPECT_EQ(history.degraded().size(), 1U);
}

TEST(EventHistory, ChiFollowsReportAfterGap) {
  for (const ContactSet before : {0U, 1U, 2U, 3U}) {
    for (const ContactSet closed : {0U, 1U, 2U, 3U}) {
      EventHistory history = started();
      history.restart(0, before, 0.0);
      history.add(report_of({}, 4, 2.0, closed));
      EXPECT_EQ(chi_of(history, before), closed);
      EXPECT_EQ(history.counts().made_up, std::popcount(before ^ closed));
      EXPECT_EQ(history.counts().lost_records, 4);
      for (const ContactEvent& event : history.events()) {
        EXPECT_GT(event.t, 0.0);
        EXPECT_LE(event.t, 2.0);
      }
      // and the next event agrees with chi
      EXPECT_TRUE(history.add(ContactEvent{3.0, 0, contains(closed, 0) ? opens : closes}));
    }
  }
}

// The last record of the report cannot be, and its contact is closed all the same.
TEST(EventHistory, ChiFollowsReportAfterGapDespiteASkippedRecord) {
  EventHistory history = started();
  history.add(report_of({{1.0, 1, pulse}, {9.0, 0, closes}}, 4, 2.0, 1));
  EXPECT_EQ(history.counts().of(Skip::beyond_horizon), 1);
  EXPECT_EQ(chi_of(history), 1U);
  EXPECT_EQ(history.counts().made_up, 1);
}

// chi before the first carried record follows from `closed` and the records. So none of the records
// contradicts the master, whatever was lost.
TEST(EventHistory, AcceptsEveryRecordOfReportAfterGap) {
  EventHistory history = started();
  history.add(report_of({{1.0, 0, closes}}, 1, 1.0, 1));
  // lost: {1.5, 0, opens}
  const Events carried{{2.0, 0, pulse}, {3.0, 0, pulse}, {4.0, 0, closes}};
  history.add(report_of(carried, 5, 5.0, 1));
  EXPECT_EQ(history.counts().lost_records, 1);
  EXPECT_EQ(history.counts().of(Skip::contradicting), 0);
  ASSERT_GE(history.events().size(), carried.size());
  EXPECT_TRUE(std::equal(carried.begin(), carried.end(), history.events().end() - 3));
  EXPECT_EQ(chi_of(history), 1U);
}

TEST(EventHistory, RecordsAndChiAgreeWithMasterAfterRandomGaps) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const Events events = random_events(random, 3, 200, 0.0, 0.01);
    const auto reports =
        reports_at(event_and_heartbeat_times(events, 0.005, events.back().t), events, 3);
    EventHistory history = started(3);
    const std::size_t first = reports.size() / 4;
    for (std::size_t i = 0; i < first; ++i) history.add(reports[i]);
    const auto known = static_cast<std::int64_t>(history.events().size());
    const double horizon = history.horizon();
    const auto joined = first + reports.size() / 4;
    const ContactMessage after_gap = with_repeats(reports[joined], random.integer(0, 12));
    const std::int64_t lost = after_gap.records_total - after_gap.records - known;
    ASSERT_GT(lost, 0);
    history.add(after_gap);
    EXPECT_EQ(history.counts().lost_records, lost);
    EXPECT_EQ(history.counts().of(Skip::contradicting), 0);
    EXPECT_EQ(chi_of(history), after_gap.closed);
    ASSERT_EQ(history.degraded().size(), 1U);
    EXPECT_GE(history.degraded()[0].from, horizon);
    EXPECT_EQ(history.degraded()[0].to,
              after_gap.records > 0 ? after_gap.record[0].t : after_gap.horizon);
    for (std::size_t i = joined + 1; i < reports.size(); ++i) history.add(reports[i]);
    const auto from = static_cast<std::size_t>(after_gap.records_total);
    const Events later(events.begin() + static_cast<std::ptrdiff_t>(from), events.end());
    ASSERT_GE(history.events().size(), later.size());
    EXPECT_TRUE(std::equal(later.rbegin(), later.rend(), history.events().rbegin()));
    EXPECT_EQ(history.counts().of(Skip::contradicting), 0);
    EXPECT_TRUE(std::is_sorted(history.events().begin(), history.events().end(),
                               [](const auto& a, const auto& b) { return a.t < b.t; }));
  }
}

// Settled ticks never change, even if a master contradicts them.
TEST(EventHistory, NoEventIsInsertedBeforeDeclaredHorizon) {
  EventHistory history = started();
  history.set_horizon(5.0);
  history.add(report_of({}, 4, 3.0, 1));
  for (const ContactEvent& event : history.events()) EXPECT_GT(event.t, 5.0);
  EXPECT_EQ(history.horizon(), 5.0);
}

// In the order of a recording: an event that is not accepted does not change what follows.
TEST(EventHistory, SkipsWhatCannotBe) {
  const auto nan = std::numeric_limits<double>::quiet_NaN();
  const std::optional<Skip> taken;
  EventHistory history = started();
  std::map<Skip, std::int64_t> skipped;
  std::int64_t accepted = 0;
  for (const auto& [event, expected] : std::vector<std::pair<ContactEvent, std::optional<Skip>>>{
           {{0.0, 1, pulse}, taken},
           {{nan, 0, pulse}, Skip::backwards},
           {{1.0, 0, opens}, Skip::contradicting},
           {{1.0, 2, pulse}, Skip::unknown_contact},
           {{1.0, -1, pulse}, Skip::unknown_contact},
           {{2.0, 0, closes}, taken},
           {{1.0, 1, pulse}, Skip::backwards},
           {{2.0, 1, pulse}, taken},
           {{3.0, 0, closes}, Skip::contradicting},
           {{3.0, 0, pulse}, Skip::contradicting},
           {{3.0, 1, pulse}, taken},
           {{4.0, 0, opens}, taken}}) {
    EXPECT_EQ(history.add(event), !expected) << event.t;
    if (expected) ++skipped[*expected];
    if (!expected) ++accepted;
  }
  // Up to a declared horizon, and at it.
  history.set_horizon(5.0);
  for (const double t : {4.5, 5.0}) EXPECT_FALSE(history.add(ContactEvent{t, 0, pulse}));
  EXPECT_TRUE(history.add(ContactEvent{5.0000001, 0, pulse}));
  skipped[Skip::backwards] += 2;
  EXPECT_EQ(history.counts().events, accepted + 1);
  for (const auto& [skip, count] : skipped) EXPECT_EQ(history.counts().of(skip), count);
}

TEST(EventHistory, RecordAfterHorizonOfItsReportIsSkippedPermanently) {
  EventHistory history = started();
  EXPECT_EQ(history.add(report_of({{1.0, 0, pulse}, {3.0, 0, pulse}}, 2, 2.0, 0)), 1U);
  EXPECT_EQ(history.counts().of(Skip::beyond_horizon), 1);
  EXPECT_EQ(history.add(report_of({{1.0, 0, pulse}, {3.0, 0, pulse}}, 2, 4.0, 0)), 0U);
  EXPECT_EQ(history.events(), (Events{{1.0, 0, pulse}}));
}

TEST(EventHistory, ARestartForgetsEventsAndKeepsCounts) {
  EventHistory history = started();
  history.add(report_of({{4.0, 0, closes}}, 8, 6.0, 1));
  history.restart(100, 2, 1.0);
  EXPECT_TRUE(history.events().empty());
  EXPECT_EQ(history.horizon(), 1.0);
  EXPECT_EQ(history.counts().lost_records, 7);
  EXPECT_EQ(history.add(report_of({{0.5, 0, closes}, {2.0, 1, opens}}, 101, 3.0, 1)), 1U);
  EXPECT_EQ(history.events(), (Events{{2.0, 1, opens}}));
  EXPECT_EQ(history.counts().lost_records, 7);
}

TEST(EventHistory, SkippedRecordsAreAGap) {
  const auto whole_to = [](double horizon, const Events& events) {
    EventHistory history = started();
    for (const ContactEvent& event : events) history.add(event);
    history.set_horizon(horizon);
    EXPECT_TRUE(history.degraded().empty());
    return history;
  };
  // Not after the watermark: settled ticks stay final.
  EventHistory late = whole_to(3.0, {{1.0, 0, closes}});
  late.add(ContactEvent{2.0, 1, pulse});
  EXPECT_EQ(late.degraded().back().from, 3.0);
  // Backwards without a watermark: incomplete from its own time.
  EventHistory backwards = whole_to(no_horizon, {{1.0, 0, closes}, {4.0, 1, pulse}});
  backwards.add(ContactEvent{2.0, 1, pulse});
  EXPECT_EQ(backwards.degraded().back().from, 2.0);
  // Contradicting: incomplete since the contact's last event.
  EventHistory again = whole_to(no_horizon, {{1.0, 0, closes}, {4.0, 1, pulse}});
  again.add(ContactEvent{5.0, 0, closes});
  EXPECT_EQ(again.degraded().back().from, 1.0);
  ASSERT_EQ(again.degraded().size(), 1U);
  EXPECT_EQ(again.degraded()[0].to, 5.0);
  EXPECT_EQ(again.last_skipped(Skip::contradicting), (ContactEvent{5.0, 0, closes}));
  EventHistory unknown = whole_to(no_horizon, {{1.0, 0, closes}});
  unknown.add(ContactEvent{5.0, 7, closes});
  EXPECT_EQ(unknown.degraded().back().from, 5.0);
  EventHistory beyond = started();
  beyond.add(report_of({{1.0, 0, pulse}, {3.0, 0, pulse}}, 2, 2.0, 0));
  EXPECT_EQ(beyond.degraded().back().from, 0.0);
}

// The number of gaps is limited; further gaps extend the last one.
TEST(EventHistory, GapsBeyondCapacityExtendLastGap) {
  EventHistory history = started(1);
  constexpr int many = 5000;
  for (int i = 1; i <= many; ++i) {
    ASSERT_TRUE(history.add(ContactEvent{2.0 * i, 0, pulse}));
    ASSERT_FALSE(history.add(ContactEvent{2.0 * i + 1.0, 0, opens}));
  }
  EXPECT_LT(history.degraded().size(), static_cast<std::size_t>(many));
  EXPECT_EQ(history.degraded().front().from, 2.0);
  EXPECT_EQ(history.degraded().back().to, 2.0 * many + 1.0);
}

TEST(EventHistory, GapsThatTouchAreOne) {
  EventHistory history = started(1);
  for (int i = 1; i <= 10; ++i) {
    ASSERT_TRUE(history.add(ContactEvent{1.0 * i, 0, pulse}));
    ASSERT_FALSE(history.add(ContactEvent{i + 1.0, 0, opens}));
  }
  ASSERT_EQ(history.degraded().size(), 1U);
  EXPECT_EQ(history.degraded()[0].from, 1.0);
  EXPECT_EQ(history.degraded()[0].to, 11.0);
}

// The gap of an earlier session must not apply to a later session.
TEST(EventHistory, AGapBelongsToItsSession) {
  EventHistory history = started();
  history.add(report_of({{4.0, 0, pulse}}, 8, 6.0, 0));
  history.restart(0, 0, no_horizon);
  history.add(report_of({{1.0, 0, pulse}}, 1, 1.0, 0));
  EXPECT_EQ(history.degraded().size(), 1U);
  history.add(report_of({{1.0, 0, pulse}, {2.0, 0, pulse}}, 9, 2.5, 0));
  EXPECT_EQ(history.degraded().back().from, 1.0);
  EXPECT_EQ(history.degraded().size(), 2U);
}

TEST(EventHistory, DropsTheOldestEvents) {
  EventHistory history = started();
  for (const double t : {1.0, 2.0, 3.0}) history.add(ContactEvent{t, 0, pulse});
  history.drop(2);
  EXPECT_EQ(history.events(), (Events{{3.0, 0, pulse}}));
  EXPECT_FALSE(history.add(ContactEvent{2.5, 0, pulse}));
  EXPECT_TRUE(history.add(ContactEvent{3.5, 0, pulse}));
}

}  // namespace
}  // namespace sprag
