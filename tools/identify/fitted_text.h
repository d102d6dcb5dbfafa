// Text of the fitted scene's file: the given file, with its comments, and with the fitted values.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/identification.h"

namespace sprag {

/// Writes Identification::fitted into the text of the scene that was fitted. The start does not
/// change if the fit does not reach back to Identification::begins.
/// \param given   text of the scene that was fitted
/// \param from    file of `given`
/// \param to      file of the result. Paths of matrix files are written relative to it;
///                matrices with fitted values are written in place.
/// \throws SceneError
std::string fitted_text(std::string_view given, const Scene& scene, const Identification& fit,
                        const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace sprag
