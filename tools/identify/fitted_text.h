// Text of the fitted scene's file: the given file, with its comments, and with the fitted values.
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

/// Writes the fitted values into the text of a scene and replaces [parameters]. The start does not
/// change if the fit does not reach back to `begins`.
/// \param given   text of the scene that was fitted
/// \param begins  start of the replica [s]
/// \param from    file of `given`
/// \param to      file of the result. Paths of matrix files are written relative to it;
///                matrices with fitted values are written in place.
/// \throws SceneError
FittedText fitted_text(std::string_view given, const Scene& scene, const Identification& fit,
                       double begins, const std::filesystem::path& from,
                       const std::filesystem::path& to);

}  // namespace sprag
