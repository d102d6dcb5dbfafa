// Parameters of an estimate <-> sprag_parameters_t (SPRAG_PARAMETERS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/named_values.h"
#include "lcmtypes/refusal.h"
#include "lcmtypes/state_codec.h"

namespace sprag {

/// Parameter estimates as in a message.
struct ParametersSample {
  std::int64_t session = 0;  ///< the master's
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = 0;     ///< k: the settled tick from which the values are used
  double t = 0.0;            ///< its simulated time [s]
  NamedValues parameters;    ///< by their keys
  double accepted = -1.0;    ///< time from which on identified ones are used [s]; -1: none are
  double known = -1.0;       ///< time of the last event that they are based on [s]; -1: none
  std::int64_t identifications = 0;
  bool from_filter = false;
};

/// Encodes the parameters of an estimate, which must have some (ParameterEstimates::any). The
/// message is in `buffer` and valid until the buffer is changed.
std::span<const std::uint8_t> encode_parameters(const EstimateSample& sample,
                                                std::vector<std::uint8_t>& buffer);

/// Reads `sample` from a message and returns Refusal::none, or why the message is refused; `sample`
/// is unspecified then.
Refusal decode(std::span<const std::uint8_t> message, ParametersSample& sample);

}  // namespace sprag
