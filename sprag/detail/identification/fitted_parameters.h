// Uncertainty of the parameters of a fit: [parameters] of the fitted scene.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Standard deviations and correlations of the parameters that are determined, not at a
/// bound and can be estimated by a filter. \param fit the fit. \param before the uncertainty in the
/// scene that was fitted; `consider` is kept. \param written the scene with the fitted values. Its
/// factors are 1, so the standard deviation of a factor is relative to the fitted value.
ParameterUncertainty fitted_parameters(const Identification& fit,
                                       const ParameterUncertainty& before, const Scene& written);

/// Correlations of all unknowns, P x P; nan where one of the two is not determined or at a bound.
Eigen::MatrixXd correlations(const Identification& fit);

/// Keys of determined parameters that a filter cannot estimate (can_be_filtered()).
std::vector<std::string> not_filtered(const Identification& fit);

}  // namespace sprag
