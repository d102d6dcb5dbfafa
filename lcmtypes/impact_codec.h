// ImpactRecord as sprag_impact_t (SPRAG_IMPACTS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/detail/estimates/impact_record.h"

namespace sprag {

/// What is said of an event, as a message. It lies in `buffer` and is valid until the buffer is
/// used again. `session`: the master's; `utime`: wall clock at send [us].
std::span<const std::uint8_t> encode_impact(const ImpactRecord& record, std::int64_t session,
                                            std::int64_t utime, std::vector<std::uint8_t>& buffer);

}  // namespace sprag
