// Encodes ImpactRecord as sprag_impact_t (SPRAG_IMPACTS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/detail/estimates/impact_record.h"

namespace sprag {

/// The message is in `buffer` and valid until the buffer is changed. `session`: the master's;
/// `utime`: wall clock at send [us].
std::span<const std::uint8_t> encode_impact(const ImpactRecord& record, std::int64_t session,
                                            std::int64_t utime, std::vector<std::uint8_t>& buffer);

}  // namespace sprag
