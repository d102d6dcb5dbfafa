// Guaranteed half-widths of an estimate <-> sprag_bounds_t (SPRAG_BOUNDS).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/refusal.h"
#include "lcmtypes/state_codec.h"
#include "sprag/model.h"

namespace sprag {

/// The half-widths of one tick as in a message.
struct BoundsSample {
  std::int64_t session = 0;  ///< the master's
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = 0;     ///< k
  double t = 0.0;            ///< simulated time of the tick [s]
  double bound = 0.0;        ///< of V
  std::int64_t refutations = 0;
  std::vector<std::string> names;
  std::vector<double> half_widths;  ///< one per name; infinite where nothing is guaranteed
};

/// `outputs` are those of the estimated model. The message is in `buffer` and valid until the
/// buffer is changed.
std::span<const std::uint8_t> encode_bounds(const EstimateSample& sample,
                                            std::span<const Output> outputs,
                                            std::vector<std::uint8_t>& buffer);

/// Reads `sample` from a message. Returns Refusal::none, or why the message is refused; `sample` is
/// unspecified then.
Refusal decode(std::span<const std::uint8_t> message, BoundsSample& sample);

}  // namespace sprag
