// Access to the unknowns of a fit by their keys.
#pragma once

#include <stdexcept>
#include <string>

#include "sprag/identification.h"

namespace sprag {

/// The unknown with this key. Throws std::invalid_argument if there is none.
inline const FittedUnknown& fitted(const Identification& fit, const std::string& key) {
  for (const FittedUnknown& unknown : fit.unknowns) {
    if (unknown.unknown.key == key) return unknown;
  }
  throw std::invalid_argument(key);
}

}  // namespace sprag
