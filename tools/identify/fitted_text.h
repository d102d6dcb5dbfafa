// The scene file of a machine that was identified: the file that was given, comments kept, with the
// fitted values in place.
#pragma once

#include <string>
#include <string_view>

#include "sprag/identification/identification.h"

namespace sprag {

/// `text` is that of the scene that was fitted, `begins` where its replica starts [s]. The start is
/// left as it is where the fit does not reach back to there. Throws SceneError.
std::string fitted_text(std::string_view text, const Scene& scene, const Identification& fit,
                        double begins, const std::string& file);

}  // namespace sprag
