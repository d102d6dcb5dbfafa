/// \file
/// \brief Reads scene files (TOML): a beam, eqs. (19)-(22) of Baumann & Leine 2014, or a general
/// linear [system].
///
/// Contacts are counted from 1 in scene files and messages, and from 0 in the Scene.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "sprag/error.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief A scene file is wrong. what() reads "file:line:column: key is value; must be ...", with
/// line and column where known.
struct SceneError : Error {
  /// \brief Error at a place in a file.
  /// \param in_file name of the file.
  /// \param at_line line, from 1.
  /// \param at_column column, from 1.
  /// \param problem text without the place.
  SceneError(std::string in_file, int at_line, int at_column, const std::string& problem);
  /// \brief Error in a file.
  /// \param in_file name of the file.
  /// \param problem text without the place.
  SceneError(std::string in_file, const std::string& problem);
  /// \brief Error without a place.
  /// \param problem the text.
  explicit SceneError(const std::string& problem);

  std::string file;     ///< empty: not known
  int line = 0;         ///< from 1; 0: not known
  int column = 0;       ///< from 1; 0: not known
  std::string message;  ///< what() without the place
};

/// \brief Reads and checks a scene file, and the matrix and vector files that it names.
///
/// These are relative to the folder of the scene file, or to the working directory if the scene
/// comes from a pipe. Limits: 64 MiB of text, keys of 32 parts, 32 nested brackets.
/// \param file path of the scene file.
/// \param names called once with the path of each existing file that the scene names, before the
/// content of the scene is checked; may be empty.
/// \return the scene.
/// \throws SceneError for a file that cannot be read or is wrong, and any exception of `names`.
Scene read_scene(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path&)>& names = {});

/// \brief Reads a scene from text.
/// \param text the TOML text.
/// \param file name for error messages; named files are relative to its folder.
/// \return the scene.
/// \throws SceneError if the text is wrong.
Scene parse_scene(std::string_view text, const std::string& file);

}  // namespace sprag
