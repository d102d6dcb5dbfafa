#include "lcmtypes/refusal.h"

#include <array>

namespace sprag {

std::string_view name(Refusal refusal) {
  constexpr std::array<std::string_view, refusal_kinds> names = {
      "none",     "wrong_type", "truncated", "oversized", "bad_count", "bad_contact",
      "bad_kind", "bad_closed", "bad_time",  "bad_speed", "bad_value"};
  static_assert(static_cast<int>(Refusal::bad_value) + 1 == refusal_kinds);
  return names.at(static_cast<std::size_t>(refusal));
}

}  // namespace sprag
