// Intervals in which contact events may be missing, because they were lost or are contradictory.
#pragma once

#include <algorithm>
#include <vector>

namespace sprag {

struct EventGap {
  double from = 0.0, to = 0.0;

  friend bool operator==(const EventGap&, const EventGap&) = default;
};

/// Adds a gap to a list of disjoint gaps in ascending order. Gaps that overlap or touch it are
/// merged with it.
inline void add(EventGap gap, std::vector<EventGap>& gaps) {
  const auto first = std::find_if(gaps.begin(), gaps.end(),
                                  [&](const EventGap& other) { return other.to >= gap.from; });
  auto last = first;
  for (; last != gaps.end() && last->from <= gap.to; ++last) {
    gap = {std::min(gap.from, last->from), std::max(gap.to, last->to)};
  }
  gaps.insert(gaps.erase(first, last), gap);
}

}  // namespace sprag
