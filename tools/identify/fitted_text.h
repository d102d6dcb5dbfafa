// The scene file of a machine that was identified: the file that was given, comments kept, with the
// fitted values in place.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/identification/identification.h"

namespace sprag {

/// `given` is the text of the scene that was fitted, in the file `from`, `begins` where its replica
/// starts [s]. The start is left as it is where the fit does not reach back to there. Files of
/// matrices that it names are named as seen from the file `to`, or written in place where what they
/// hold was fitted. Throws SceneError.
std::string fitted_text(std::string_view given, const Scene& scene, const Identification& fit,
                        double begins, const std::filesystem::path& from,
                        const std::filesystem::path& to);

}  // namespace sprag
