// Checks that no output of a command line overwrites an input or another output. A file and a link
// to it count as the same file.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace sprag {

struct NamedFile {
  enum class Use { read, written };

  std::string option;  ///< as the user writes it, "--replay" or "SCENE"
  std::filesystem::path path;
  Use use = Use::read;
};

/// Describes the first pair of options of which one would overwrite the file of the other; empty if
/// there is none. Opens nothing. Two files are the same if they have the same path after links are
/// resolved, which works for files that do not exist yet, or the same device and inode. Files that
/// are not regular (/dev/null, a pipe) may be named twice, since writing does not destroy them.
std::string overwritten(std::span<const NamedFile> files);

}  // namespace sprag
