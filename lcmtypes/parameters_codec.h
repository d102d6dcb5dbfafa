// An estimate's parameters <-> sprag_parameters_t (SPRAG_PARAMETERS).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/named_values.h"
#include "lcmtypes/refusal.h"
#include "lcmtypes/state_codec.h"

namespace sprag {

/// What is known of a machine's parameters, as a message has it.
struct ParametersSample {
  std::int64_t session = 0;  ///< the master's
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = 0;     ///< k: the settled tick from which this holds
  double t = 0.0;            ///< its simulated time [s]
  NamedValues parameters;    ///< by their keys
  double accepted = -1.0;    ///< since when identified ones count [s]; -1: none do
  double known = -1.0;       ///< the last event that they are from [s]; -1: none
  std::int64_t identifications = 0;
  bool from_filter = false;
};

/// What the estimate says of parameters, which it must have (ParameterEstimates::any), as a
/// message. It lies in `buffer` and is valid until the buffer is used again.
std::span<const std::uint8_t> encode_parameters(const EstimateSample& sample,
                                                std::vector<std::uint8_t>& buffer);

/// Fills `sample` from a message and returns Refusal::none, or why the message is refused; `sample`
/// then holds nothing of use.
Refusal decode(std::span<const std::uint8_t> message, ParametersSample& sample);

}  // namespace sprag
