// A scene file (TOML): either a beam, eqs. (19)-(22) of Baumann & Leine 2014, or a general linear
// [system].
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/mechanics/error.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

/// what() reads "file:line:column: key is value; must be ..." (line and column where known).
struct SceneError : Error {
  using Error::Error;
};

/// Reads and checks a scene file. Throws SceneError.
Scene read_scene(const std::filesystem::path& file);

/// The same from text; `file` is the name that errors carry. Throws SceneError.
Scene parse_scene(std::string_view text, const std::string& file);

}  // namespace sprag
