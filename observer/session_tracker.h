// Which master is being heard, and what became of its messages on the way. A restarted master has a
// new session; messages of a session that was left are ignored from then on. While a master is
// heard another one on the same channel is not.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "mechanics/contact_report.h"
#include "observer/arrival.h"

namespace sprag {

struct MessageCounts {
  std::int64_t received = 0;
  std::int64_t lost = 0;  ///< numbers never seen
  std::int64_t doubled = 0;
  std::int64_t reordered = 0;  ///< arrived after a later one
  std::int64_t of_past_sessions = 0;
  std::int64_t of_other_masters = 0;  ///< beside the one that is heard
  std::int64_t stale = 0;             ///< began a session too late to be what it says
  std::int64_t sessions = 0;
};

/// Whether a message that begins a session must have been sent just now, by the wall clocks of both
/// hosts, and after all that was heard before. With a key this keeps out what somebody recorded.
enum class Freshness { any, required };

class SessionTracker {
 public:
  explicit SessionTracker(Freshness freshness = Freshness::any) : freshness_(freshness) {
    past_.reserve(max_past);
  }

  enum class Verdict { starts, continues, ignored };

  /// Does not allocate. `ignored`: doubled, or not of the master that is heard.
  Verdict hear(const ContactReport& report, const Arrival& arrival) {
    ++counts_.received;
    if (counts_.sessions > 0 && report.session == session_) {
      const Verdict verdict = continue_session(report.sequence);
      if (verdict == Verdict::continues) note(report, arrival);
      return verdict;
    }
    for (const std::int64_t past : past_) {
      if (past == report.session) {
        ++counts_.of_past_sessions;
        return Verdict::ignored;
      }
    }
    if (freshness_ == Freshness::required && !fresh(report, arrival)) {
      ++counts_.stale;
      return Verdict::ignored;
    }
    if (heard_now(report, arrival)) {
      ++counts_.of_other_masters;
      ++others_in_a_row_;
      other_ = report.session;
      return Verdict::ignored;
    }
    if (counts_.sessions > 0) {
      if (past_.size() == max_past) past_.erase(past_.begin());
      past_.push_back(session_);
    }
    ++counts_.sessions;
    session_ = report.session;
    first_ = last_ = report.sequence;
    seen_ = 1;
    note(report, arrival);
    return Verdict::starts;
  }

  std::int64_t session() const { return session_; }
  /// Session of the last other master.
  std::int64_t other() const { return other_; }
  const MessageCounts& counts() const { return counts_; }

 private:
  static constexpr std::size_t max_past = 64;
  static constexpr std::int64_t silence = 100'000'000;     // ns, ten heartbeats: the master is gone
  static constexpr int others_meanwhile = 50;              // or as many messages of another
  static constexpr std::int64_t largest_age = 10'000'000;  // us

  void note(const ContactReport& report, const Arrival& arrival) {
    paced_ = report.speed < std::numeric_limits<double>::infinity();
    heard_ = arrival.monotonic;
    last_utime_ = std::max(last_utime_, report.utime);
    others_in_a_row_ = 0;
  }

  bool fresh(const ContactReport& report, const Arrival& arrival) const {
    const std::int64_t age = delay(report.utime, arrival);
    return age >= -largest_age && age <= largest_age && report.utime >= last_utime_;
  }

  // An unpaced master may be followed by the next at once; what it sends does not wait.
  bool heard_now(const ContactReport& report, const Arrival& arrival) const {
    return counts_.sessions > 0 && paced_ &&
           report.speed < std::numeric_limits<double>::infinity() &&
           arrival.monotonic - heard_ < silence && others_in_a_row_ < others_meanwhile;
  }

  // Bit i of `seen_` stands for sequence number last_ - i.
  Verdict continue_session(std::int64_t sequence) {
    if (sequence > last_) {
      const std::int64_t step = sequence - last_;
      counts_.lost += step - 1;
      seen_ = step < 64 ? (seen_ << step) | 1U : 1U;
      last_ = sequence;
      return Verdict::continues;
    }
    const std::int64_t age = last_ - sequence;
    const std::uint64_t bit = age < 64 ? std::uint64_t{1} << age : 0;
    if (bit == 0 || (seen_ & bit) != 0) {
      ++counts_.doubled;
      return Verdict::ignored;
    }
    seen_ |= bit;
    if (sequence > first_) --counts_.lost;
    ++counts_.reordered;
    return Verdict::continues;
  }

  Freshness freshness_;
  std::int64_t session_ = 0;
  std::int64_t first_ = 0;
  std::int64_t last_ = 0;
  std::uint64_t seen_ = 0;
  std::vector<std::int64_t> past_;
  bool paced_ = false;
  std::int64_t heard_ = 0;  // monotonic [ns]
  std::int64_t last_utime_ = 0;
  int others_in_a_row_ = 0;
  std::int64_t other_ = 0;
  MessageCounts counts_;
};

}  // namespace sprag
