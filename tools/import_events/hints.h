// Recognizes properties of the recording, not of the machine: contacts that are too short to be
// sustained, and time stamps of a sensor that is polled.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sprag/detail/import/import.h"

namespace sprag {

/// A hint, one line each, to use --debounce and --pulse-shorter-than for each contact whose
/// sustained contacts, or the pauses between them, are shorter than a millisecond or a thousandth
/// of the median interval between its closings.
std::vector<std::string> hints_at_bounces(const Import& import);

/// Time stamps that come in batches, since a sensor is polled and all events since the last poll
/// get the time of the poll.
struct Batches {
  double period = 0.0;     ///< of the sensor [s]
  std::size_t events = 0;  ///< number of events in batches of more than one
};

/// Finds batches if the gaps between closings are of two kinds, more than a factor of ten apart,
/// and the distances of the batches are multiples of one period. Closings ascending in time.
std::optional<Batches> find_batches(std::span<const Closing> closings);

/// Message for the user.
std::string to_text(const Batches& batches, std::size_t closings);

}  // namespace sprag
