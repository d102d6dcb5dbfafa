// Prediction as sprag_prediction_t (SPRAG_PREDICTION).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sprag/prediction.h"

namespace sprag {

/// What is foreseen, as a message. It lies in `buffer` and is valid until the buffer is used again.
/// `session`: the master's; `utime`: wall clock at send [us].
std::span<const std::uint8_t> encode_prediction(const Prediction& prediction, std::int64_t session,
                                                std::int64_t utime,
                                                std::vector<std::uint8_t>& buffer);

}  // namespace sprag
