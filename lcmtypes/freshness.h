// Decides whether a message that begins a session was sent recently. With a key this rejects
// replays of recorded messages, whose tags are valid.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sprag {

/// Whether a message that begins a session must be recent.
enum class Freshness { any, required };

class FreshnessRule {
 public:
  explicit FreshnessRule(Freshness freshness) : freshness_(freshness) {}

  /// Whether a message sent at `utime` that arrives at `now` may begin a session. It must have been
  /// sent within 10 s by the wall clocks of both hosts [us], and not before earlier accepted ones.
  bool allows(std::int64_t utime, std::int64_t now) const {
    if (freshness_ == Freshness::any) return true;
    const bool just_now = utime >= now - largest_age && utime <= now + largest_age;
    // A value of last_ from a wrong clock, in the future, is not used.
    return just_now && (utime >= last_ || last_ > now + largest_age);
  }

  /// Records the time of a message of the followed session.
  void note(std::int64_t utime) { last_ = std::max(last_, utime); }

 private:
  static constexpr std::int64_t largest_age = 10'000'000;

  Freshness freshness_;
  std::int64_t last_ = 0;
};

}  // namespace sprag
