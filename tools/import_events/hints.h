// What imported events look like, apart from the machine: contacts too short to be sustained, and
// stamps of a sensor that is read now and then.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/import_events/import.h"

namespace sprag {

/// A hint at --debounce and --pulse-shorter-than for each contact whose sustained contacts are
/// shorter than a millisecond or a thousandth of the median interval between its closings, or
/// follow as closely on each other; a line each.
std::vector<std::string> hints_at_bounces(const Import& import);

/// Stamps that come in batches: of a sensor that is read periodically, which stamps all that has
/// happened since with the time at which it is read.
struct Batches {
  double period = 0.0;     ///< of the sensor [s]
  std::size_t events = 0;  ///< that share a batch with others
};

/// Where gaps between closings fall into two kinds, more than ten times apart, and the starts of
/// batches are whole multiples of one period apart. Closings ascending in time.
std::optional<Batches> find_batches(std::span<const Closing> closings);

/// For people.
std::string to_text(const Batches& batches, std::size_t closings);

}  // namespace sprag
