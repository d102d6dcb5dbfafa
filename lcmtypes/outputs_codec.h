// An estimate's outputs, the quantities that a scene names, as sprag_outputs_t (SPRAG_OUTPUTS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/state_codec.h"
#include "sprag/mechanics/model.h"

namespace sprag {

/// `outputs` are those of the model that is estimated. The message lies in `buffer` and is valid
/// until the buffer is used again.
std::span<const std::uint8_t> encode_outputs(const EstimateSample& sample, bool settled,
                                             std::span<const Output> outputs,
                                             std::vector<std::uint8_t>& buffer);

}  // namespace sprag
