// The events of a record with the repairs of a fit: lost ones in their places, spurious ones
// marked.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

struct RepairedEvent {
  ContactEvent event;
  std::optional<std::size_t> number = {};  ///< in the record, from 0; none: it was lost
  bool spurious = false;
};

/// In order of time. `events` is the record of the fit; a lost event has the time that the fit
/// gives it.
std::vector<RepairedEvent> repaired_events(std::span<const ContactEvent> events,
                                           const Identification& fit);

}  // namespace sprag
