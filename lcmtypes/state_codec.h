// StateSample <-> sprag_state_t (SPRAG_TRUTH) and EstimateSample <-> sprag_estimate_t
// (SPRAG_ESTIMATE, SPRAG_SETTLED).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "lcmtypes/refusal.h"
#include "sprag/confidence.h"
#include "sprag/contact_event.h"

namespace sprag {

/// A machine's state at one tick; q and u have f >= 1 entries each.
struct StateSample {
  std::int64_t session = 0;  ///< the master's
  std::int64_t utime = 0;    ///< wall clock at send [us]
  std::int64_t tick = 0;     ///< k
  double t = 0.0;            ///< simulated time of the tick [s]
  Eigen::VectorXd q, u;      ///< the scene's units; u after an event at t
  ContactSet closed = 0;     ///< chi
};

struct EstimateSample : StateSample {
  std::int64_t settled_tick = -1;  ///< last settled tick; -1: none
  Confidence confidence;
};

/// Encodes a sample. The message is in `buffer`, which grows only when f or m does, and valid until
/// the buffer is changed. Requires q and u of one length, and sigma_q and sigma_u of that length or
/// empty.
std::span<const std::uint8_t> encode(const StateSample& sample, std::vector<std::uint8_t>& buffer);
std::span<const std::uint8_t> encode(const EstimateSample& sample,
                                     std::vector<std::uint8_t>& buffer);

/// Reads `sample` from a message and returns Refusal::none, or why the message is refused; `sample`
/// is unspecified then. Allocates only when f grows, and never more than the message's length.
/// Accepted: f >= 1, tick >= 0, settled_tick >= -1, t >= 0, all numbers finite, except the bound
/// and the standard deviations, which are >= 0 and may be infinite; sigma of all coordinates or of
/// none.
Refusal decode(std::span<const std::uint8_t> message, StateSample& sample);
Refusal decode(std::span<const std::uint8_t> message, EstimateSample& sample);

}  // namespace sprag
