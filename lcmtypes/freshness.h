// Whether a message that begins a session was sent just now. With a key this keeps out what
// somebody has recorded, whose tags are right.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sprag {

class Freshness {
 public:
  /// Whether a message sent at `utime`, which arrives at `now`, may begin a session: within 10 s,
  /// by the wall clocks of both hosts [us], and after all that was heard before.
  bool fresh(std::int64_t utime, std::int64_t now) const {
    const bool just_now = utime >= now - largest_age && utime <= now + largest_age;
    // What was heard while a clock was wrong says nothing any more.
    return just_now && (utime >= last_ || last_ > now + largest_age);
  }

  /// Takes notice of a message of the session that is heard.
  void note(std::int64_t utime) { last_ = std::max(last_, utime); }

 private:
  static constexpr std::int64_t largest_age = 10'000'000;

  std::int64_t last_ = 0;
};

}  // namespace sprag
