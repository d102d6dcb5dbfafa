// The events of a record with the repairs of a fit: lost events are inserted, spurious ones marked.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "sprag/events_file.h"
#include "sprag/identification.h"

namespace sprag {

struct RepairedEvent {
  ContactEvent event;
  std::optional<std::size_t> number = {};  ///< number in the record, from 0; empty: lost event
  bool spurious = false;
};

/// Returns the events in order of time. `events` is the record of the fit. A lost event has the
/// time of the fit.
std::vector<RepairedEvent> repaired_events(std::span<const ContactEvent> events,
                                           const Identification& fit);

struct NotedEvent {
  ContactEvent event;
  EventNote note = EventNote::none;
};

/// The same events with their notes: lost, spurious, or suspect for one whose residual exceeds four
/// standard deviations. The fit has converged.
std::vector<NotedEvent> noted_events(std::span<const ContactEvent> events,
                                     const Identification& fit);

}  // namespace sprag
