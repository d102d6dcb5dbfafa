#include "observer/session_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/support/random.h"

namespace sprag {
namespace {

using Verdict = SessionTracker::Verdict;

ContactReport message(std::int64_t session, std::int64_t sequence) {
  ContactReport report;
  report.session = session;
  report.sequence = sequence;
  return report;
}

TEST(SessionTracker, CountsLostDoubledAndReorderedMessagesExactly) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double loss = random.uniform(0.0, 0.6);
    struct Arrival {
      double time;
      std::int64_t sequence;
    };
    const std::int64_t first = random.integer(1, 1000);
    std::vector<Arrival> arrivals{{-1.0, first}};
    for (std::int64_t i = 1; i < 500; ++i) {
      if (random.chance(loss)) continue;
      const auto at = static_cast<double>(i);
      const bool late = random.chance(0.25);
      arrivals.push_back({at + (late ? random.uniform(0.0, 30.0) : 0.0), first + i});
      if (random.chance(0.2)) arrivals.push_back({at + random.uniform(0.0, 30.0), first + i});
    }
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.time < b.time; });
    SessionTracker tracker;
    std::set<std::int64_t> heard;
    MessageCounts expected;
    for (const Arrival& arrival : arrivals) {
      const Verdict verdict = tracker.hear(message(7, arrival.sequence));
      ++expected.received;
      const bool starts = heard.empty();
      const bool late = !starts && arrival.sequence < *heard.rbegin();
      const bool is_new = heard.insert(arrival.sequence).second;
      if (!is_new) ++expected.doubled;
      if (is_new && late) ++expected.reordered;
      EXPECT_EQ(verdict, starts ? Verdict::starts : is_new ? Verdict::continues : Verdict::ignored);
      expected.lost = *heard.rbegin() - first + 1 - static_cast<std::int64_t>(heard.size());
      ASSERT_EQ(tracker.counts().lost, expected.lost);
    }
    EXPECT_EQ(tracker.counts().received, expected.received);
    EXPECT_EQ(tracker.counts().doubled, expected.doubled);
    EXPECT_EQ(tracker.counts().reordered, expected.reordered);
    EXPECT_EQ(tracker.counts().sessions, 1);
    EXPECT_EQ(tracker.counts().of_past_sessions, 0);
    EXPECT_EQ(tracker.session(), 7);
  }
}

// Numbers before the first one heard were never counted as lost.
TEST(SessionTracker, AMessageFromBeforeTheFirstOneHeardWasNotLost) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.hear(message(7, 5)), Verdict::starts);
  tracker.hear(message(7, 4));
  EXPECT_EQ(tracker.counts().lost, 0);
  EXPECT_EQ(tracker.hear(message(7, 6)), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 0);
  tracker.hear(message(7, 9));
  EXPECT_EQ(tracker.counts().lost, 2);
}

TEST(SessionTracker, ALongGapIsCounted) {
  SessionTracker tracker;
  tracker.hear(message(7, 1));
  EXPECT_EQ(tracker.hear(message(7, 1001)), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 999);
  EXPECT_EQ(tracker.hear(message(7, 1000)), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 998);
  EXPECT_EQ(tracker.hear(message(7, 1000)), Verdict::ignored);
  EXPECT_EQ(tracker.hear(message(7, 1001)), Verdict::ignored);
  EXPECT_EQ(tracker.counts().doubled, 2);
}

TEST(SessionTracker, ARestartedMasterIsANewSession) {
  SessionTracker tracker;
  tracker.hear(message(7, 100));
  EXPECT_EQ(tracker.hear(message(8, 3)), Verdict::starts);
  EXPECT_EQ(tracker.session(), 8);
  EXPECT_EQ(tracker.counts().sessions, 2);
  EXPECT_EQ(tracker.hear(message(8, 4)), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 0);
}

TEST(SessionTracker, LateMessagesOfASessionThatWasLeftAreIgnored) {
  SessionTracker tracker;
  for (std::int64_t session = 1; session <= 50; ++session) {
    EXPECT_EQ(tracker.hear(message(session, 1)), Verdict::starts);
    for (std::int64_t past = 1; past < session; ++past) {
      EXPECT_EQ(tracker.hear(message(past, 1000)), Verdict::ignored);
    }
    EXPECT_EQ(tracker.session(), session);
  }
  EXPECT_EQ(tracker.counts().of_past_sessions, 50 * 49 / 2);
  EXPECT_EQ(tracker.counts().sessions, 50);
}

TEST(SessionTracker, SessionZeroIsASession) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.hear(message(0, 1)), Verdict::starts);
  EXPECT_EQ(tracker.hear(message(0, 2)), Verdict::continues);
}

}  // namespace
}  // namespace sprag
