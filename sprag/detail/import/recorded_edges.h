// The contact events of one contact from a whole recording of its edges.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "sprag/detail/import/contact_edges.h"
#include "sprag/detail/import/contact_stream.h"

namespace sprag {

/// Times of the edges [s], each list ascending.
struct RecordedEdges {
  std::span<const double> closings, openings, impacts;
};

/// An edge that contradicts the ones before it.
struct RefusedEdge {
  EdgeKind kind;
  std::size_t index;  ///< in its list
  std::string what;
};

struct RecordedEvents {
  std::vector<ContactEvent> events;  ///< times ascending
  EdgeCounts counts;
  std::vector<RefusedEdge> refused;  ///< a closing while closed, an opening while open, and so on
};

/// Events by the rules of contact_edges.h; `contact` from 0. Of a closing and an opening at one
/// instant the one that is possible comes first. A contact that never opens stays closed.
RecordedEvents events_of(int contact, const RecordedEdges& edges, const EdgeRules& rules);

}  // namespace sprag
