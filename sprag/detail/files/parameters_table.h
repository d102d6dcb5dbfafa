// The table [parameters] of a scene file: the uncertainty of parameters of its machine.
#pragma once

#include "sprag/detail/files/toml_reader.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Reads [parameters] of the document `root`; empty without that table.
/// \param scene contains the machine whose parameters the table names.
/// \return the parameters in the order of the file.
/// \throws SceneError for a parameter that the machine does not have or a filter cannot estimate, a
/// standard deviation that is not positive, and correlations that are not positive semidefinite.
ParameterUncertainty read_parameters(const TomlTable& root, const Scene& scene);

}  // namespace sprag
