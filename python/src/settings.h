// Settings of observers from the arguments of Python functions.
#pragma once

#include <string>

#include "sprag/observer.h"

namespace sprag::python {

/// Throws std::invalid_argument for an unknown name.
EstimatorKind to_estimator(const std::string& name);
/// Throws std::invalid_argument for an unknown name.
ObserverSettings to_settings(double tick, const std::string& estimator);

}  // namespace sprag::python
