// Writes contact events as an LCM log of SPRAG_CONTACTS, like the messages of a master.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "lcmtypes/key.h"
#include "sprag/contact_event.h"

namespace sprag {

/// Writes `events` (times ascending) of a machine with `contacts` contacts. The log has a message
/// at t = 0, then one for each event or for up to 60 events within 10 ms (a heartbeat), at the time
/// of the last one, and a last message with watermark `end` [s] if that is later. Heartbeats
/// between events are omitted. Time stamps are the simulated times, and the session is a hash of
/// the events, so that the same events give the same file. With a key each message carries its tag.
/// Returns the number of messages. Throws std::runtime_error if the file cannot be written.
std::int64_t write_contact_log(const std::filesystem::path& file,
                               std::span<const ContactEvent> events, int contacts, double end,
                               const std::optional<Key>& key);

}  // namespace sprag
