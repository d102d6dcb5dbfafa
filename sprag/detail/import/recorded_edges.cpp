#include "sprag/detail/import/recorded_edges.h"

#include <limits>
#include <utility>

namespace sprag {

RecordedEvents events_of(int contact, const RecordedEdges& edges, const EdgeRules& rules) {
  constexpr double never = std::numeric_limits<double>::infinity();
  ContactEdges taken(contact, rules);
  RecordedEvents result;
  const auto note = [&result](EdgeKind kind, std::size_t index, std::string what) {
    if (!what.empty()) result.refused.push_back({kind, index, std::move(what)});
  };
  std::size_t on = 0, off = 0;
  while (on < edges.closings.size() || off < edges.openings.size()) {
    const double next_on = on < edges.closings.size() ? edges.closings[on] : never;
    const double next_off = off < edges.openings.size() ? edges.openings[off] : never;
    if (next_on < next_off || (next_on == next_off && !taken.closed())) {
      note(EdgeKind::closes, on, taken.close(next_on));
      ++on;
    } else {
      note(EdgeKind::opens, off, taken.open(next_off));
      ++off;
    }
  }
  for (std::size_t i = 0; i < edges.impacts.size(); ++i) {
    note(EdgeKind::impact, i, taken.impact(edges.impacts[i]));
  }
  taken.finish();
  result.events = taken.take_events();
  result.counts = taken.counts();
  return result;
}

}  // namespace sprag
