// Check of a state that a caller gives.
#pragma once

#include <stdexcept>
#include <string>

#include "sprag/model.h"

namespace sprag {

/// Throws std::invalid_argument unless the state has f coordinates and f velocities.
inline void require_size(const State& state, Eigen::Index f, const std::string& name) {
  if (state.q.size() == f && state.u.size() == f) return;
  throw std::invalid_argument(name + " has " + std::to_string(state.q.size()) +
                              " coordinates and " + std::to_string(state.u.size()) +
                              " velocities; must have " + std::to_string(f) + " each");
}

}  // namespace sprag
