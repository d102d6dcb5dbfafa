// Outputs of an estimate, the quantities that a scene defines <-> sprag_outputs_t (SPRAG_OUTPUTS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/named_values.h"
#include "lcmtypes/refusal.h"
#include "lcmtypes/state_codec.h"
#include "sprag/model.h"

namespace sprag {

/// The outputs of one tick as in a message.
struct OutputsSample {
  std::int64_t session = 0;  ///< the master's
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = 0;     ///< k
  double t = 0.0;            ///< simulated time of the tick [s]
  bool settled = false;
  bool from_filter = false;
  NamedValues outputs;
};

/// `outputs` are those of the estimated model. The message is in `buffer` and valid until the
/// buffer is changed.
std::span<const std::uint8_t> encode_outputs(const EstimateSample& sample, bool settled,
                                             std::span<const Output> outputs,
                                             std::vector<std::uint8_t>& buffer);

/// Reads `sample` from a message and returns Refusal::none, or why the message is refused; `sample`
/// is unspecified then.
Refusal decode(std::span<const std::uint8_t> message, OutputsSample& sample);

}  // namespace sprag
