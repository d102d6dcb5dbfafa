// The events of a fit as an events CSV with a column `note`: lost events are inserted at the fit's
// impacts; spurious and suspect events are marked.
#pragma once

#include <filesystem>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/identification.h"

namespace sprag {

/// Writes the file. `events` are those that were fitted, in the machine's time; the file has that
/// of `clock`. Notes: "lost" for an inserted event; "spurious" for an unused one, which readers
/// skip; "suspect" for one whose residual exceeds four standard deviations. Throws
/// std::runtime_error if the file cannot be written.
void write_mended(const std::filesystem::path& file, std::span<const ContactEvent> events,
                  const ContactClock& clock, const Identification& fit);

}  // namespace sprag
