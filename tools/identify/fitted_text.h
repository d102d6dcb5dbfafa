// The scene file of a machine that was identified: the file that was given, comments kept, with the
// fitted values in place.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/identification.h"

namespace sprag {

struct FittedText {
  std::string text;
  /// Keys of fitted parameters that [parameters] cannot list (fitted_parameters.h).
  std::vector<std::string> not_filtered;
};

/// `given` is the text of the scene that was fitted, in the file `from`, `begins` where its replica
/// starts [s]. The start is left as it is where the fit does not reach back to there. Files of
/// matrices that it names are named as seen from the file `to`, or written in place where what they
/// hold was fitted. [parameters] is replaced. Throws SceneError.
FittedText fitted_text(std::string_view given, const Scene& scene, const Identification& fit,
                       double begins, const std::filesystem::path& from,
                       const std::filesystem::path& to);

}  // namespace sprag
