// Decides which master is followed, and counts its lost, repeated and reordered messages. While a
// master is followed, other masters on the same channel are ignored. A restarted master has a new
// session. It is followed when the old session is silent and three messages of the new one have
// arrived, since a single message with any session may come from any sender. Silence does not count
// while messages are being dropped on this host. An unpaced master (a simulation, a file) is
// replaced by the first message of the next one and is never followed again. In a log that was
// joined from several recordings, a recording may begin with another master.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "lcmtypes/freshness.h"
#include "recording/arrival.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {

/// The property of a message that is inconsistent with earlier ones.
enum class Oddity { none, time, speed, number, records };

/// Checks that the messages of a master continue each other. A single inconsistent message is
/// refused: it may come from another sender or be an error. Three consecutive messages that are
/// consistent with each other, but not with the earlier ones, are accepted: the master's clock was
/// set, a host was suspended, or the first message received was the wrong one.
class Continuity {
 public:
  /// `h`: the observer's tick [s]. Numbers above half of max_tick, and times after as many ticks,
  /// are refused.
  explicit Continuity(double h) : latest_(static_cast<double>(plausible_number) * h) {}

  /// fits: consistent with the accepted messages. odd: inconsistent, refused. resumes:
  /// inconsistent, but accepted since the odd messages before it agree with it.
  enum class Verdict { fits, odd, resumes };

  /// The property of the message that is out of range, whatever came before it; or Oddity::none.
  Oddity impossible(const ContactMessage& message) const {
    if (!(message.horizon <= latest_)) return Oddity::time;
    if (message.speed > fastest && message.speed < infinity) return Oddity::speed;
    if (message.sequence > plausible_number) return Oddity::number;
    if (message.records_total > plausible_number) return Oddity::records;
    return Oddity::none;
  }

  /// Accepts the first message of a session.
  void restart(const ContactMessage& message, const Arrival& arrival) {
    known_ = of(message, arrival);
    agreeing_ = 0;
  }

  /// Checks a later message of the same session. `resumes`: this message and the odd messages
  /// before it are consistent with each other. It becomes the reference for the next ones.
  Verdict receive(const ContactMessage& message, const Arrival& arrival) {
    oddity_ = between(known_, message, arrival);
    if (oddity_ == Oddity::none) {
      if (message.sequence > known_.number) {
        const double horizon = std::max(known_.horizon, message.horizon);
        known_ = of(message, arrival);
        known_.horizon = horizon;
        agreeing_ = 0;
      }
      return Verdict::fits;
    }
    const bool agrees = agreeing_ > 0 && message.sequence > candidate_.number &&
                        between(candidate_, message, arrival) == Oddity::none;
    agreeing_ = agrees ? agreeing_ + 1 : 1;
    candidate_ = of(message, arrival);
    if (agreeing_ < enough) return Verdict::odd;
    known_ = candidate_;
    agreeing_ = 0;
    return Verdict::resumes;
  }

  /// The inconsistency of the last message.
  Oddity oddity() const { return oddity_; }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr int enough = 3;
  static constexpr double fastest = 1e9;            // simulated s per s
  static constexpr double largest_step = 10.0;      // s, of time ahead of the expected one
  static constexpr double largest_step_back = 0.5;  // s
  static constexpr double most_at_once = 1e6;       // messages or records
  static constexpr double most_in_a_second = 1e7;   // of these, in addition
  static constexpr std::int64_t plausible_number = max_tick / 2;

  struct Known {
    std::int64_t number = 0, records = 0;
    double horizon = 0.0, speed = 1.0;
    std::int64_t monotonic = 0;
  };

  static Known of(const ContactMessage& message, const Arrival& arrival) {
    return {message.sequence, message.records_total, message.horizon, message.speed,
            arrival.monotonic};
  }

  static Oddity between(const Known& known, const ContactMessage& message, const Arrival& arrival) {
    if (message.speed != known.speed) return Oddity::speed;
    const double elapsed =
        1e-9 * static_cast<double>(std::max<std::int64_t>(arrival.monotonic - known.monotonic, 0));
    const double most = most_at_once + most_in_a_second * elapsed;
    const auto further = static_cast<double>(message.sequence - known.number);
    if (further > most || further < -most_at_once) return Oddity::number;
    if (static_cast<double>(message.records_total - known.records) > most) return Oddity::records;
    const bool paced = known.speed < infinity;
    if (paced && message.horizon > known.horizon + known.speed * (elapsed + largest_step)) {
      return Oddity::time;
    }
    if (message.sequence <= known.number) {
      // A message with an old number must have an old watermark.
      return message.horizon > known.horizon ? Oddity::number : Oddity::none;
    }
    const double back = paced ? known.speed * largest_step_back : 0.0;
    if (message.horizon < known.horizon - back) return Oddity::time;
    return message.records_total < known.records ? Oddity::records : Oddity::none;
  }

  double latest_;
  Known known_;                   // of the last accepted message
  Known candidate_;               // of the last odd message
  int agreeing_ = 0;              // consecutive odd messages that are consistent with each other
  Oddity oddity_ = Oddity::none;  // of the last message
};

struct MessageCounts {
  std::int64_t received = 0;
  std::int64_t lost = 0;  ///< numbers not received
  std::int64_t doubled = 0;
  std::int64_t reordered = 0;  ///< arrived after a later one
  std::int64_t of_past_sessions = 0;
  std::int64_t of_other_masters = 0;  ///< ignored while another master was followed
  std::int64_t stale = 0;             ///< would have begun a session, but were sent too long ago
  std::int64_t implausible = 0;       ///< out of range, or inconsistent with earlier messages
  std::int64_t resumed = 0;           ///< times that a session continued after a jump
  std::int64_t sessions = 0;
};

class SessionTracker {
 public:
  /// `h`: the observer's tick [s].
  explicit SessionTracker(Freshness freshness = Freshness::any, double h = 1e-6)
      : freshness_(freshness), continuity_(h), candidates_(max_candidates) {
    past_.reserve(max_past);
  }

  /// starts: begins a new session. resumes: the session continues after a jump of its clock or
  /// counts.
  enum class Verdict { starts, continues, resumes, ignored };

  /// Classifies a message; `ignored`: repeated, implausible, or not of the followed master. Does
  /// not allocate.
  Verdict receive(const ContactMessage& message, const Arrival& arrival) {
    ++counts_.received;
    if (arrival.appended) appended_ = true;
    oddity_ = continuity_.impossible(message);
    if (oddity_ != Oddity::none) return refuse();
    if (counts_.sessions > 0 && message.session == session_)
      return receive_followed(message, arrival);
    if (!freshness_.allows(message.utime, arrival.wall)) {
      ++counts_.stale;
      return Verdict::ignored;
    }
    if (counts_.sessions > 0 && !succeeds(message, arrival)) return Verdict::ignored;
    if (counts_.sessions > 0) {
      if (past_.size() == max_past) past_.erase(past_.begin());
      past_.push_back({session_, last_});
    }
    ++counts_.sessions;
    appended_ = false;
    session_ = message.session;
    first_ = last_ = message.sequence;
    seen_ = 1;
    note(message, arrival);
    continuity_.restart(message, arrival);
    return Verdict::starts;
  }

  /// Records that messages were dropped at this monotonic time [ns], possibly those of the master.
  void note_drop(std::int64_t monotonic) { dropped_ = std::max(dropped_, monotonic); }

  /// Why the last message was implausible; `none` if it was accepted or ignored for another reason.
  Oddity oddity() const { return oddity_; }

  std::int64_t session() const { return session_; }
  /// Session of the last other master.
  std::int64_t other() const { return other_; }
  const MessageCounts& counts() const { return counts_; }

 private:
  static constexpr std::size_t max_past = 64;
  // More sessions than are seen between two heartbeats of a master, except in a flood.
  static constexpr std::size_t max_candidates = 1024;
  static constexpr std::int64_t silence = 100'000'000;  // ns, ten heartbeats
  static constexpr int enough_messages = 3;             // of a new session

  struct Past {
    std::int64_t session, last;
  };
  struct Candidate {
    std::int64_t session = 0;
    std::int64_t last = -1;  // sequence number
    int messages = 0;        // with rising numbers; 0: unused slot
  };

  Verdict refuse() {
    ++counts_.implausible;
    return Verdict::ignored;
  }

  Verdict receive_followed(const ContactMessage& message, const Arrival& arrival) {
    switch (continuity_.receive(message, arrival)) {
      case Continuity::Verdict::odd:
        oddity_ = continuity_.oddity();
        return refuse();
      case Continuity::Verdict::resumes:
        oddity_ = continuity_.oddity();
        ++counts_.resumed;
        first_ = last_ = message.sequence;
        seen_ = 1;
        note(message, arrival);
        return Verdict::resumes;
      case Continuity::Verdict::fits:
        break;
    }
    const Verdict verdict = continue_session(message.sequence);
    if (verdict == Verdict::continues) note(message, arrival);
    return verdict;
  }

  void note(const ContactMessage& message, const Arrival& arrival) {
    paced_ = is_paced(message);
    appended_ = false;
    received_ = arrival.monotonic;
    freshness_.note(message.utime);
  }

  // Whether the message's master replaces the followed one.
  bool succeeds(const ContactMessage& message, const Arrival& arrival) {
    for (Past& past : past_) {
      if (past.session != message.session) continue;
      ++counts_.of_past_sessions;
      if (message.sequence <= past.last) return false;
      return appended_ ||
             (is_paced(message) && silent(arrival) && messages_of(message) >= enough_messages);
    }
    if (!paced_ || appended_) return true;
    if (messages_of(message) >= enough_messages && silent(arrival)) return true;
    ++counts_.of_other_masters;
    other_ = message.session;
    return false;
  }

  static bool is_paced(const ContactMessage& message) {
    return message.speed < std::numeric_limits<double>::infinity();
  }

  bool silent(const Arrival& arrival) const {
    return arrival.monotonic - std::max(received_, dropped_) >= silence;
  }

  // Counts this message and returns the number of messages of its session.
  int messages_of(const ContactMessage& message) {
    for (Candidate& candidate : candidates_) {
      if (candidate.messages == 0 || candidate.session != message.session) continue;
      if (message.sequence > candidate.last) {
        candidate.last = message.sequence;
        ++candidate.messages;
      }
      return candidate.messages;
    }
    candidates_[next_candidate_] = {message.session, message.sequence, 1};
    next_candidate_ = (next_candidate_ + 1) % max_candidates;
    return 1;
  }

  // Bit i of `seen_` is set if sequence number last_ - i has been received.
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

  FreshnessRule freshness_;
  Continuity continuity_;
  Oddity oddity_ = Oddity::none;
  std::int64_t session_ = 0;
  std::int64_t first_ = 0;
  std::int64_t last_ = 0;
  std::uint64_t seen_ = 0;
  std::vector<Past> past_;
  std::vector<Candidate> candidates_;
  std::size_t next_candidate_ = 0;
  bool paced_ = false;
  // An appended recording has begun, and no message of it was accepted.
  bool appended_ = false;
  std::int64_t received_ = 0;  // monotonic [ns]
  std::int64_t dropped_ = std::numeric_limits<std::int64_t>::min() / 2;
  std::int64_t other_ = 0;
  MessageCounts counts_;
};

}  // namespace sprag
