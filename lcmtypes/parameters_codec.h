// An estimate's parameters as sprag_parameters_t (SPRAG_PARAMETERS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/state_codec.h"

namespace sprag {

/// What the estimate says of parameters, which it must have (ParameterEstimates::any), as a
/// message. It lies in `buffer` and is valid until the buffer is used again.
std::span<const std::uint8_t> encode_parameters(const EstimateSample& sample,
                                                std::vector<std::uint8_t>& buffer);

}  // namespace sprag
