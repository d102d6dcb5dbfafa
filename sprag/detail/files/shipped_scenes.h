// Finds the scenes that are shipped with Sprag by name, so that `paper_beam` is valid wherever
// Sprag is installed.
#pragma once

#include <filesystem>
#include <string>

namespace sprag {

/// The folder of shipped scenes of the installation, or of the build tree, that contains the
/// program or module `file`: its parent folders are searched for share/sprag/scenes
/// (CMAKE_INSTALL_DATADIR in place of share). The absolute path, with links resolved; empty if
/// there is no such folder.
std::filesystem::path shipped_scenes(const std::filesystem::path& file);

/// The .toml file of this name, with or without its ending, in a folder; empty if there is none, or
/// no folder.
std::filesystem::path shipped_file(const std::string& name, const std::filesystem::path& folder);

/// The file that an argument SCENE names, a path or a name for shipped_file(): `given` if it is a
/// file (or a pipe) or contains a slash, else the shipped file of this name; `given` if there is
/// none.
std::filesystem::path find_scene(const std::filesystem::path& given,
                                 const std::filesystem::path& folder);

/// Why find_scene() found no file: the folder searched, and the nearest names. Follows "NAME:
/// cannot be read: "; empty if `given` is a file or contains a slash, since its name is not
/// searched then.
std::string scene_not_found(const std::filesystem::path& given,
                            const std::filesystem::path& folder);

}  // namespace sprag
