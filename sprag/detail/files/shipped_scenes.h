// Finds the scenes that come with Sprag by their names, so that `paper_beam` names one wherever
// Sprag is installed.
#pragma once

#include <filesystem>
#include <string>

namespace sprag {

/// \brief The folder of the scenes of the installation, or of the build tree, that `file` belongs
/// to. \param file a file of it, a program or a module; its folders are searched upwards for
///   share/sprag/scenes (CMAKE_INSTALL_DATADIR in place of share)
/// \return the absolute path, with links resolved; empty if there is no such folder
std::filesystem::path shipped_scenes(const std::filesystem::path& file);

/// \brief The file of a name in a folder.
/// \param name the name of a .toml file of `folder`, with or without this ending
/// \param folder the folder that is searched; empty: none
/// \return the file; empty if there is none
std::filesystem::path shipped_file(const std::string& name, const std::filesystem::path& folder);

/// \brief The file that an argument SCENE names.
/// \param given a path, or a name for shipped_file()
/// \param folder the folder that is searched; empty: none
/// \return `given` if it is a file (a pipe counts) or contains a slash; else the file of this name
/// in
///   `folder`; `given` if there is none
std::filesystem::path find_scene(const std::filesystem::path& given,
                                 const std::filesystem::path& folder);

/// \brief Explains why find_scene() has found no file: where it has looked, and the nearest names.
/// \return a text for the end of "NAME: cannot be read: "; empty if `given` is a file or contains a
///   slash, since then its name was not searched
std::string scene_not_found(const std::filesystem::path& given,
                            const std::filesystem::path& folder);

}  // namespace sprag
