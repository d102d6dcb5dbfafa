// A scene file (TOML): either a beam, eqs. (19)-(22) of Baumann & Leine 2014, or a general linear
// [system].
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "sprag/error.h"
#include "sprag/scene.h"

namespace sprag {

/// what() reads "file:line:column: key is value; must be ..." (line and column where known).
struct SceneError : Error {
  SceneError(std::string in_file, int at_line, int at_column, const std::string& problem);
  SceneError(std::string in_file, const std::string& problem);
  explicit SceneError(const std::string& problem);

  std::string file;     ///< empty: not known
  int line = 0;         ///< from 1; 0: not known
  int column = 0;       ///< from 1; 0: not known
  std::string message;  ///< what() behind the place
};

/// Reads and checks a scene file, and the files of matrices and vectors that it names, relative to
/// its folder (to the working directory where it is a pipe). Limits: 64 MiB of text, keys of 32
/// parts, 32 nested brackets. `names` is told them, those that there
/// are, before anything else in the text can be wrong. Throws SceneError, and what `names` throws.
Scene read_scene(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path&)>& names = {});

/// The same from text; `file` is the name that errors carry, and its folder is that of the files
/// that are named. Throws SceneError.
Scene parse_scene(std::string_view text, const std::string& file);

}  // namespace sprag
