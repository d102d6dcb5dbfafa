// An estimate at one tick, as it passes from the integrating thread to the outputs.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"

namespace sprag {

/// q and u have f >= 1 entries each.
struct EstimateSample {
  std::int64_t session = 0;        ///< the master's
  std::int64_t utime = 0;          ///< wall clock at send [us]
  std::int64_t tick = 0;           ///< k
  double t = 0.0;                  ///< simulated time of the tick [s]
  Eigen::VectorXd q, u;            ///< the scene's units; u after an event at t
  ContactSet closed = 0;           ///< chi
  std::int64_t settled_tick = -1;  ///< last settled tick; -1: none
  Confidence confidence;
};

}  // namespace sprag
