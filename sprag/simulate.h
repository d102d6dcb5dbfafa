// A machine's run in one call: its contact events and its states at ticks, by the exact master.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/model.h"

namespace sprag {

struct Simulation {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::vector<ContactEvent> events;  ///< in order
  Eigen::VectorXd t;                 ///< n entries: k h [s]
  Rows q, u;                         ///< n x f, right-continuous
};

/// From `start` at t = 0 up to `duration`, with the states at every tick h > 0; no states where h
/// is 0. Throws ModelError, SimulationError, std::invalid_argument, or Interrupted (interrupt.h).
Simulation simulate(const Model& model, const State& start, double duration, double h);

}  // namespace sprag
