/// \file
/// \brief Simulates a machine with exact flows, event by event.
#pragma once

#include <Eigen/Core>
#include <stop_token>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"
#include "sprag/model.h"

namespace sprag {

/// \brief The simulation cannot continue; what() gives time and reason.
struct SimulationError : Error {
  using Error::Error;
};

/// \brief Contact events of a machine, and its states at n ticks.
struct Simulation {
  /// \brief Matrix stored by rows.
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  std::vector<ContactEvent> events;  ///< in order of time; contacts from 0
  Eigen::VectorXd t;                 ///< n entries: k h [s]
  Rows q, u;                         ///< n x f, right-continuous
};

/// \brief Simulates from t = 0.
/// \param model the machine, f coordinates.
/// \param start state at t = 0.
/// \param duration end of the simulation [s].
/// \param h step between states [s]; 0: no states.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return events up to `duration`, and states at all ticks up to it.
/// \throws ModelError if the machine has no exact flow.
/// \throws SimulationError if the master cannot continue.
/// \throws std::invalid_argument for an argument outside of its range.
/// \throws Interrupted if `stop` was requested.
Simulation simulate(const Model& model, const State& start, double duration, double h,
                    std::stop_token stop = {});

}  // namespace sprag
