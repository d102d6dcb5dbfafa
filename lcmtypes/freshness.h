// Whether a message that begins a session was sent just now. With a key this keeps out what
// somebody has recorded, whose tags are right.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sprag {

/// Whether a message that begins a session must have been sent just now.
enum class Freshness { any, required };

class FreshnessRule {
 public:
  explicit FreshnessRule(Freshness freshness) : freshness_(freshness) {}

  /// Whether a message sent at `utime`, which arrives at `now`, may begin a session: within 10 s,
  /// by the wall clocks of both hosts [us], and after all that was heard before.
  bool allows(std::int64_t utime, std::int64_t now) const {
    if (freshness_ == Freshness::any) return true;
    const bool just_now = utime >= now - largest_age && utime <= now + largest_age;
    // What was heard while a clock was wrong says nothing any more.
    return just_now && (utime >= last_ || last_ > now + largest_age);
  }

  /// Takes notice of a message of the session that is heard.
  void note(std::int64_t utime) { last_ = std::max(last_, utime); }

 private:
  static constexpr std::int64_t largest_age = 10'000'000;

  Freshness freshness_;
  std::int64_t last_ = 0;
};

}  // namespace sprag
