// The events that a fit used, as an events CSV with a column `note`: lost events inserted where the
// fit has their impacts, spurious ones and suspects marked.
#pragma once

#include <filesystem>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/identification.h"

namespace sprag {

/// `events` are those that were fitted. Notes: "lost" of an inserted event; "spurious" of one that
/// is not used, which readers skip; "suspect" of one whose time is off by more than four of its
/// deviations. Throws std::runtime_error if the file cannot be written.
void write_mended(const std::filesystem::path& file, std::span<const ContactEvent> events,
                  const Identification& fit);

}  // namespace sprag
