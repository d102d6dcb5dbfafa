// The levels of confidence by name, for scene files, options and Python.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "sprag/confidence.h"

namespace sprag {

/// Names and levels; `Level` is ConfidenceLevel, or an optional one.
template <class Level>
std::vector<std::pair<std::string, Level>> confidence_choices() {
  using enum ConfidenceLevel;
  return {{name(low), low}, {name(medium), medium}, {name(high), high}};
}

}  // namespace sprag
