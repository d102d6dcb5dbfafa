// Reasons to refuse a message. Senders on the bus are not authenticated, so any bytes may arrive.
#pragma once

#include <cstdint>
#include <string_view>

#include "sprag/detail/mechanics/instant.h"

namespace sprag {

enum class Refusal {
  none,
  wrong_type,   ///< another type hash
  truncated,    ///< shorter than its type or its own lengths require
  oversized,    ///< longer than that
  bad_count,    ///< an invalid number of contacts, records, messages or coordinates
  bad_contact,  ///< a record of a contact that the machine does not have
  bad_kind,     ///< a record that is neither closes, opens nor pulse
  bad_closed,   ///< a closed contact that the machine does not have
  bad_time,     ///< a time that is negative or not finite, or records out of order
  bad_speed,    ///< not a number, or not positive
  bad_value     ///< another value out of range, for example a coordinate that is not finite
};

/// Larger numbers of messages, records and samples are refused, like those of ticks.
inline constexpr std::int64_t largest_number = max_tick;

inline constexpr int refusal_kinds = 11;

/// "none", "wrong_type", ...: the enumerator's name.
std::string_view name(Refusal refusal);

}  // namespace sprag
