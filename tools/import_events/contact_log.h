// Contact events as an LCM log of SPRAG_CONTACTS, as if a master had sent them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>

#include "lcmtypes/key.h"
#include "sprag/contact_event.h"

namespace sprag {

/// Writes `events` (times ascending) of a machine with `contacts` contacts: a message at t = 0 and
/// then one for each event or for up to 60 of them within 10 ms, a heartbeat, at the last one's
/// time, and a last one with horizon `end` [s] if that is later. Heartbeats between events are left
/// out. Time stamps are the simulated times; the session depends on what is written alone, so that
/// the same events give the same file. With a key each message carries its tag. Returns how many
/// messages there are; throws std::runtime_error if the file cannot be written.
std::int64_t write_contact_log(const std::filesystem::path& file,
                               std::span<const ContactEvent> events, int contacts, double end,
                               const std::optional<Key>& key);

}  // namespace sprag
