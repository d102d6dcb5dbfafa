// The uncertainty of the parameters that identify found, as the fitted scene carries it.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/mechanics/parameter_uncertainty.h"
#include "sprag/identification.h"

namespace sprag {

struct FittedParameters {
  ParameterUncertainty uncertainty;
  /// Keys of parameters that were determined and that a filter cannot follow.
  std::vector<std::string> left_out;
};

/// \brief Standard deviations and correlations of the parameters that are determined and not at a
/// bound.
/// \param written is the scene with the fitted values, whose factors are 1 again: a standard
/// deviation of a factor is relative to its fitted value.
/// \return `consider` as the scene that was fitted has it.
FittedParameters fitted_parameters(const Identification& fit, const Scene& written);

}  // namespace sprag
