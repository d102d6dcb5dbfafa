// Would catch losses that are miscounted, a second master that takes over a run, and a restarted
// one that is not followed.
#include "recording/session_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

#include "sprag/detail/mechanics/scalars.h"
#include "tests/support/random.h"

namespace sprag {
namespace {

using Verdict = SessionTracker::Verdict;

ContactMessage message(std::int64_t session, std::int64_t sequence) {
  ContactMessage report;
  report.session = session;
  report.sequence = sequence;
  return report;
}

/// Each arrival is long after the previous one.
Arrival later() {
  static std::int64_t seconds = 0;
  ++seconds;
  return {seconds * 1'000'000'000, seconds * 1'000'000};
}

Arrival after_ms(std::int64_t milliseconds) {
  return {milliseconds * 1'000'000, 50'000'000 + milliseconds * 1000};
}

TEST(SessionTracker, CountsLostDuplicateAndReorderedMessagesExactly) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    const double loss = random.uniform(0.0, 0.6);
    struct Delivery {
      double time;
      std::int64_t sequence;
    };
    const std::int64_t first = random.integer(1, 1000);
    std::vector<Delivery> arrivals{{-1.0, first}};
    for (std::int64_t i = 1; i < 500; ++i) {
      if (random.chance(loss)) continue;
      const auto at = static_cast<double>(i);
      const bool late = random.chance(0.25);
      arrivals.push_back({at + (late ? random.uniform(0.0, 30.0) : 0.0), first + i});
      if (random.chance(0.2)) arrivals.push_back({at + random.uniform(0.0, 30.0), first + i});
    }
    std::stable_sort(arrivals.begin(), arrivals.end(),
                     [](const Delivery& a, const Delivery& b) { return a.time < b.time; });
    SessionTracker tracker;
    std::set<std::int64_t> received;
    MessageCounts expected;
    for (const Delivery& arrival : arrivals) {
      const Verdict verdict = tracker.receive(message(7, arrival.sequence), later());
      ++expected.received;
      const bool starts = received.empty();
      const bool late = !starts && arrival.sequence < *received.rbegin();
      const bool is_new = received.insert(arrival.sequence).second;
      if (!is_new) ++expected.doubled;
      if (is_new && late) ++expected.reordered;
      EXPECT_EQ(verdict, starts ? Verdict::starts : is_new ? Verdict::continues : Verdict::ignored);
      expected.lost = *received.rbegin() - first + 1 - static_cast<std::int64_t>(received.size());
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

// Numbers before the first received one do not count as lost.
TEST(SessionTracker, MessageBeforeFirstReceivedOneIsNotLost) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.receive(message(7, 5), later()), Verdict::starts);
  tracker.receive(message(7, 4), later());
  EXPECT_EQ(tracker.counts().lost, 0);
  EXPECT_EQ(tracker.receive(message(7, 6), later()), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 0);
  tracker.receive(message(7, 9), later());
  EXPECT_EQ(tracker.counts().lost, 2);
}

TEST(SessionTracker, ALongGapIsCounted) {
  SessionTracker tracker;
  tracker.receive(message(7, 1), later());
  EXPECT_EQ(tracker.receive(message(7, 1001), later()), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 999);
  EXPECT_EQ(tracker.receive(message(7, 1000), later()), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 998);
  EXPECT_EQ(tracker.receive(message(7, 1000), later()), Verdict::ignored);
  EXPECT_EQ(tracker.receive(message(7, 1001), later()), Verdict::ignored);
  EXPECT_EQ(tracker.counts().doubled, 2);
}

/// Three messages of a restarted master, long after the last message of the previous session.
Verdict restart(SessionTracker& tracker, std::int64_t session, std::int64_t first) {
  EXPECT_EQ(tracker.receive(message(session, first), later()), Verdict::ignored);
  EXPECT_EQ(tracker.receive(message(session, first + 1), later()), Verdict::ignored);
  return tracker.receive(message(session, first + 2), later());
}

TEST(SessionTracker, ARestartedMasterIsANewSession) {
  SessionTracker tracker;
  tracker.receive(message(7, 100), later());
  EXPECT_EQ(restart(tracker, 8, 1), Verdict::starts);
  EXPECT_EQ(tracker.session(), 8);
  EXPECT_EQ(tracker.counts().sessions, 2);
  EXPECT_EQ(tracker.receive(message(8, 4), later()), Verdict::continues);
  EXPECT_EQ(tracker.counts().lost, 0);
}

TEST(SessionTracker, LateMessagesOfEarlierSessionAreIgnored) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.receive(message(1, 1000), later()), Verdict::starts);
  for (std::int64_t session = 2; session <= 50; ++session) {
    EXPECT_EQ(restart(tracker, session, 998), Verdict::starts);
    for (std::int64_t past = 1; past < session; ++past) {
      EXPECT_EQ(tracker.receive(message(past, 1000), later()), Verdict::ignored);
    }
    EXPECT_EQ(tracker.session(), session);
  }
  EXPECT_EQ(tracker.counts().of_past_sessions, 50 * 49 / 2);
  EXPECT_EQ(tracker.counts().sessions, 50);
}

// The master was silent for a while, and another one was followed instead.
TEST(SessionTracker, ResumingMasterIsFollowedAgain) {
  SessionTracker tracker;
  tracker.receive(message(7, 100), later());
  EXPECT_EQ(restart(tracker, 8, 1), Verdict::starts);
  EXPECT_EQ(restart(tracker, 7, 101), Verdict::starts);
}

// A sender of single messages with random sessions is not followed, and does not prevent following
// a restarted master.
TEST(SessionTracker, RandomSessionsAreNotFollowed) {
  SessionTracker tracker;
  Random random(3);
  tracker.receive(message(7, 0), after_ms(0));
  std::int64_t sequence = 0;
  for (std::int64_t ms = 1; ms < 300; ++ms) {
    for (int i = 0; i < 25; ++i) {
      const std::int64_t session = 1000 + random.integer(0, 1'000'000'000);
      ASSERT_EQ(tracker.receive(message(session, i), after_ms(ms)), Verdict::ignored);
    }
    if (ms < 150 || ms % 10 != 0) continue;
    if (tracker.receive(message(8, ++sequence), after_ms(ms)) == Verdict::starts) break;
  }
  EXPECT_EQ(tracker.session(), 8);
  EXPECT_EQ(sequence, 3);
}

TEST(SessionTracker, FirstOfTwoMastersIsKept) {
  SessionTracker tracker;
  for (std::int64_t i = 0; i < 500; ++i) {
    EXPECT_EQ(tracker.receive(message(7, i), after_ms(10 * i)),
              i == 0 ? Verdict::starts : Verdict::continues);
    EXPECT_EQ(tracker.receive(message(8, i), after_ms(10 * i + 5)), Verdict::ignored);
  }
  EXPECT_EQ(tracker.session(), 7);
  EXPECT_EQ(tracker.other(), 8);
  EXPECT_EQ(tracker.counts().sessions, 1);
  EXPECT_EQ(tracker.counts().of_other_masters, 500);
}

TEST(SessionTracker, RestartedMasterIsFollowedAfterTenSilentHeartbeats) {
  SessionTracker tracker;
  tracker.receive(message(7, 0), after_ms(0));
  for (std::int64_t i = 1; i < 10; ++i) {
    EXPECT_EQ(tracker.receive(message(8, i), after_ms(10 * i)), Verdict::ignored);
  }
  EXPECT_EQ(tracker.receive(message(8, 10), after_ms(100)), Verdict::starts);
  EXPECT_EQ(tracker.receive(message(7, 1), after_ms(101)), Verdict::ignored);
  EXPECT_EQ(tracker.counts().of_past_sessions, 1);
}

TEST(SessionTracker, NextMasterReplacesUnpacedOneAtOnce) {
  SessionTracker tracker;
  ContactMessage report = message(7, 0);
  report.speed = infinity;
  EXPECT_EQ(tracker.receive(report, after_ms(0)), Verdict::starts);
  EXPECT_EQ(tracker.receive(message(8, 0), after_ms(1)), Verdict::starts);
  report.session = 9;
  EXPECT_EQ(tracker.receive(report, after_ms(2)), Verdict::ignored);
}

// Both go on sending, as a simulation beside one that was started later.
TEST(SessionTracker, AReplacedUnpacedMasterIsNotFollowedAgain) {
  SessionTracker tracker;
  const auto unpaced = [](std::int64_t session, std::int64_t sequence) {
    ContactMessage report = message(session, sequence);
    report.speed = infinity;
    return report;
  };
  EXPECT_EQ(tracker.receive(unpaced(7, 0), after_ms(0)), Verdict::starts);
  for (std::int64_t i = 1; i < 50; ++i) {
    EXPECT_EQ(tracker.receive(unpaced(8, i), after_ms(10 * i)),
              i == 1 ? Verdict::starts : Verdict::continues);
    EXPECT_EQ(tracker.receive(unpaced(7, i), after_ms(10 * i + 5)), Verdict::ignored);
  }
  // Nor when the other one has been silent for long.
  for (std::int64_t i = 0; i < 10; ++i)
    EXPECT_EQ(tracker.receive(unpaced(7, 100 + i), after_ms(100'000 + i)), Verdict::ignored);
  EXPECT_EQ(tracker.counts().sessions, 2);
  EXPECT_EQ(tracker.counts().of_past_sessions, 59);
}

TEST(SessionTracker, AnAppendedRecordingMayBeginWithAnotherMaster) {
  SessionTracker tracker;
  const auto appended = [](Arrival arrival) {
    arrival.appended = true;
    return arrival;
  };
  EXPECT_EQ(tracker.receive(message(7, 0), after_ms(0)), Verdict::starts);
  EXPECT_EQ(tracker.receive(message(7, 1), appended(after_ms(1))), Verdict::continues);
  EXPECT_EQ(tracker.receive(message(8, 0), after_ms(2)), Verdict::ignored);
  EXPECT_EQ(tracker.receive(message(8, 0), appended(after_ms(3))), Verdict::starts);
  EXPECT_EQ(tracker.receive(message(7, 2), after_ms(4)), Verdict::ignored);
  // The recording of the first master again, and its continuation.
  EXPECT_EQ(tracker.receive(message(7, 0), appended(after_ms(5))), Verdict::ignored);
  EXPECT_EQ(tracker.receive(message(7, 2), after_ms(6)), Verdict::starts);
}

// With a key nobody can forge a message, but anybody can resend a recorded one.
TEST(SessionTracker, RecordedSessionIsRefusedIfFreshnessIsRequired) {
  SessionTracker tracker(Freshness::required);
  const auto sent = [](std::int64_t session, std::int64_t sequence, const Arrival& at,
                       std::int64_t age_ms) {
    ContactMessage report = message(session, sequence);
    report.utime = at.wall - 1000 * age_ms;
    return report;
  };
  const Arrival start = after_ms(0);
  EXPECT_EQ(tracker.receive(sent(5, 0, start, 10'001), start), Verdict::ignored);
  EXPECT_EQ(tracker.receive(sent(5, 0, start, -10'001), start), Verdict::ignored);
  for (const std::int64_t utime : {std::numeric_limits<std::int64_t>::min(), std::int64_t{-1},
                                   std::numeric_limits<std::int64_t>::max()}) {
    ContactMessage report = message(5, 0);
    report.utime = utime;
    EXPECT_EQ(tracker.receive(report, start), Verdict::ignored);
  }
  EXPECT_EQ(tracker.counts().stale, 5);
  EXPECT_EQ(tracker.receive(sent(7, 0, start, 200), start), Verdict::starts);
  // Within a session the message numbers decide, even if a message is late.
  EXPECT_EQ(tracker.receive(sent(7, 1, after_ms(60'000), 59'000), after_ms(60'000)),
            Verdict::continues);
  EXPECT_EQ(tracker.receive(sent(7, 1, after_ms(60'001), 0), after_ms(60'001)), Verdict::ignored);
  // Recorded shortly before the present session began.
  EXPECT_EQ(tracker.receive(sent(6, 0, after_ms(5000), 5300), after_ms(5000)), Verdict::ignored);
  EXPECT_EQ(tracker.counts().stale, 6);
  for (std::int64_t i = 0; i < 3; ++i) {
    EXPECT_EQ(tracker.receive(sent(9, i, after_ms(70'000), 1), after_ms(70'000)),
              i < 2 ? Verdict::ignored : Verdict::starts);
  }
}

TEST(SessionTracker, ClockOnceAYearAheadDoesNotBlockLaterSessions) {
  SessionTracker tracker(Freshness::required);
  ContactMessage report = message(7, 0);
  report.utime = after_ms(0).wall;
  EXPECT_EQ(tracker.receive(report, after_ms(0)), Verdict::starts);
  report.sequence = 1;
  report.utime += std::int64_t{31'536'000} * 1'000'000;
  EXPECT_EQ(tracker.receive(report, after_ms(10)), Verdict::continues);
  for (std::int64_t i = 0; i < 3; ++i) {
    ContactMessage next = message(8, i);
    next.utime = after_ms(20'000).wall;
    EXPECT_EQ(tracker.receive(next, after_ms(20'000)), i < 2 ? Verdict::ignored : Verdict::starts);
  }
  EXPECT_EQ(tracker.counts().stale, 0);
}

// The dropped packets may include the master's messages.
TEST(SessionTracker, SilenceDoesNotCountWhileMessagesAreDropped) {
  SessionTracker tracker;
  tracker.receive(message(7, 0), after_ms(0));
  for (std::int64_t i = 1; i < 100; ++i) {
    tracker.note_drop(after_ms(10 * i - 90).monotonic);
    EXPECT_EQ(tracker.receive(message(8, i), after_ms(10 * i)), Verdict::ignored);
  }
  EXPECT_EQ(tracker.receive(message(8, 100), after_ms(1000)), Verdict::starts);
}

TEST(SessionTracker, ImplausibleMessageIsRefusedAndJumpFollowed) {
  SessionTracker tracker;
  const auto at_time = [](std::int64_t sequence, double horizon) {
    ContactMessage report = message(7, sequence);
    report.horizon = horizon;
    return report;
  };
  EXPECT_EQ(tracker.receive(at_time(0, 5.0), after_ms(0)), Verdict::starts);
  EXPECT_EQ(tracker.receive(at_time(1, 500.0), after_ms(10)), Verdict::ignored);
  EXPECT_EQ(tracker.oddity(), Oddity::time);
  EXPECT_EQ(tracker.receive(at_time(std::int64_t{1} << 53, 5.0), after_ms(10)), Verdict::ignored);
  EXPECT_EQ(tracker.oddity(), Oddity::number);
  EXPECT_EQ(tracker.receive(at_time(2, 5.02), after_ms(20)), Verdict::continues);
  EXPECT_EQ(tracker.oddity(), Oddity::none);
  EXPECT_EQ(tracker.receive(at_time(3, 70.03), after_ms(30)), Verdict::ignored);
  EXPECT_EQ(tracker.receive(at_time(4, 70.04), after_ms(40)), Verdict::ignored);
  EXPECT_EQ(tracker.receive(at_time(5, 70.05), after_ms(50)), Verdict::resumes);
  EXPECT_EQ(tracker.receive(at_time(6, 70.06), after_ms(60)), Verdict::continues);
  EXPECT_EQ(tracker.counts().implausible, 4);
  EXPECT_EQ(tracker.counts().resumed, 1);
  EXPECT_EQ(tracker.counts().sessions, 1);
}

TEST(SessionTracker, ImpossibleMessageDoesNotStartSession) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.receive(message(7, std::int64_t{1} << 53), after_ms(0)), Verdict::ignored);
  EXPECT_EQ(tracker.oddity(), Oddity::number);
  EXPECT_EQ(tracker.counts().implausible, 1);
  EXPECT_EQ(tracker.counts().sessions, 0);
  EXPECT_EQ(tracker.receive(message(7, 1), after_ms(10)), Verdict::starts);
}

TEST(SessionTracker, SessionZeroIsValid) {
  SessionTracker tracker;
  EXPECT_EQ(tracker.receive(message(0, 1), later()), Verdict::starts);
  EXPECT_EQ(tracker.receive(message(0, 2), later()), Verdict::continues);
}

}  // namespace
}  // namespace sprag
