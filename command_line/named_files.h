// The files that a command line names, and that no output is written over an input or over another
// output: F.csv and a link to it are one file, whatever they are called.
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace sprag {

struct NamedFile {
  enum class Use { read, written };

  std::string option;  ///< as people give it, "--replay" or "SCENE"
  std::filesystem::path path;
  Use use = Use::read;
};

/// Names two options, and their file, of which one would be written over the other; empty if there
/// are none. Opens nothing. Files are one if they have the same path once links are resolved, which
/// tells it of files that do not exist yet as well, or the same device and inode. What is no
/// regular file (/dev/null, a pipe) is not destroyed by being written to, and may be named again.
std::string overwritten(std::span<const NamedFile> files);

}  // namespace sprag
