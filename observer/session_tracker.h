// Which master is being heard, and what became of its messages on the way. A restarted master has a
// new session; messages of a session that was left are ignored from then on.
#pragma once

#include <cstdint>
#include <vector>

#include "mechanics/contact_report.h"

namespace sprag {

struct MessageCounts {
  std::int64_t received = 0;
  std::int64_t lost = 0;  ///< numbers never seen
  std::int64_t doubled = 0;
  std::int64_t reordered = 0;  ///< arrived after a later one
  std::int64_t of_past_sessions = 0;
  std::int64_t sessions = 0;
};

class SessionTracker {
 public:
  SessionTracker() { past_.reserve(max_past); }

  enum class Verdict { starts, continues, ignored };

  /// Does not allocate. `ignored`: doubled, or of a session that was left.
  Verdict hear(const ContactReport& report) {
    ++counts_.received;
    if (counts_.sessions > 0 && report.session == session_)
      return continue_session(report.sequence);
    for (const std::int64_t past : past_) {
      if (past == report.session) {
        ++counts_.of_past_sessions;
        return Verdict::ignored;
      }
    }
    if (counts_.sessions > 0) {
      if (past_.size() == max_past) past_.erase(past_.begin());
      past_.push_back(session_);
    }
    ++counts_.sessions;
    session_ = report.session;
    first_ = last_ = report.sequence;
    seen_ = 1;
    return Verdict::starts;
  }

  std::int64_t session() const { return session_; }
  const MessageCounts& counts() const { return counts_; }

 private:
  static constexpr std::size_t max_past = 64;

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

  std::int64_t session_ = 0;
  std::int64_t first_ = 0;
  std::int64_t last_ = 0;
  std::uint64_t seen_ = 0;
  std::vector<std::int64_t> past_;
  MessageCounts counts_;
};

}  // namespace sprag
