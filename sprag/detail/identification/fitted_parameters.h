// Uncertainty of the parameters that identify has determined, for [parameters] of the fitted scene.
#pragma once

#include <string>
#include <vector>

#include "sprag/identification.h"
#include "sprag/uncertainty.h"

namespace sprag {

struct FittedParameters {
  ParameterUncertainty uncertainty;
  /// Keys of determined parameters that a filter cannot estimate.
  std::vector<std::string> left_out;
};

/// \brief Standard deviations and correlations of the parameters that are determined and not at a
/// bound.
/// \param written the scene with the fitted values. Its factors are 1, so the standard deviation of
/// a factor is relative to the fitted value.
/// \return `consider` is that of the scene that was fitted.
FittedParameters fitted_parameters(const Identification& fit, const Scene& written);

}  // namespace sprag
