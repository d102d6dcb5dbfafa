// Why a message is refused. Nobody on the bus is authenticated, and anything may arrive.
#pragma once

#include <string_view>

namespace sprag {

enum class Refusal {
  none,
  wrong_type,   ///< another type hash
  truncated,    ///< shorter than its type or its own lengths say
  oversized,    ///< longer than that
  bad_count,    ///< a number of contacts, records, messages or coordinates that cannot be
  bad_contact,  ///< a record of a contact that the machine does not have
  bad_kind,     ///< a record that neither closes, opens nor is a pulse
  bad_closed,   ///< a contact is closed that the machine does not have
  bad_time,     ///< a time that is negative or not finite, records that are not in order
  bad_speed,    ///< not a number, or not positive
  bad_value     ///< a coordinate or velocity that is not finite
};

inline constexpr int refusal_kinds = 11;

/// "none", "wrong_type", ...: the enumerator's name.
std::string_view name(Refusal refusal);

}  // namespace sprag
