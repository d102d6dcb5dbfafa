// Checks that the messages of a master continue each other. A single inconsistent message is
// refused: it may come from another sender or be an error. Three consecutive messages that are
// consistent with each other, but not with the earlier ones, are accepted: the master's clock was
// set, a host was suspended, or the first message received was the wrong one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "recording/arrival.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {

/// The property of a message that is inconsistent with earlier ones.
enum class Oddity { none, time, speed, number, records };

class Continuity {
 public:
  /// `h`: the observer's tick [s]. Times after half of max_tick ticks are refused.
  explicit Continuity(double h) : latest_(0.5 * static_cast<double>(max_tick) * h) {}

  /// fits: consistent with the accepted messages. odd: inconsistent, refused. resumes:
  /// inconsistent, but accepted since the odd messages before it agree with it.
  enum class Verdict { fits, odd, resumes };

  /// The property of the message that is out of range, whatever came before it; or Oddity::none.
  Oddity impossible(const ContactMessage& message) const {
    if (!(message.horizon <= latest_)) return Oddity::time;
    if (message.speed > fastest && message.speed < infinity) return Oddity::speed;
    if (message.sequence > largest_number) return Oddity::number;
    if (message.records_total > largest_number) return Oddity::records;
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
  static constexpr std::int64_t largest_number = std::int64_t{1} << 52;

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

}  // namespace sprag
