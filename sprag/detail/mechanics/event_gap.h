// Lists of intervals in which contact events may be missing.
#pragma once

#include <algorithm>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag {

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
