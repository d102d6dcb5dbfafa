#include "command_line/named_files.h"

#include <system_error>

namespace sprag {
namespace {

using std::filesystem::path;

/// The path that open() would reach, even through a link to a file that does not exist yet.
path resolved(path file) {
  constexpr int most_links = 40;  // the kernel's own limit
  std::error_code error;
  for (int i = 0; i < most_links && std::filesystem::is_symlink(file, error); ++i) {
    const path target = std::filesystem::read_symlink(file, error);
    if (error) break;
    file = file.parent_path() / target;  // target alone if it is absolute
  }
  // weakly_canonical() leaves a relative path unchanged if the file does not exist.
  const path canonical =
      std::filesystem::weakly_canonical(std::filesystem::absolute(file, error), error);
  return error ? file.lexically_normal() : canonical;
}

bool same(const path& a, const path& b) {
  std::error_code error;
  const auto status = std::filesystem::status(a, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) return false;
  if (std::filesystem::equivalent(a, b, error)) return true;
  return resolved(a) == resolved(b);
}

}  // namespace

std::string overwritten(std::span<const NamedFile> files) {
  for (std::size_t i = 0; i < files.size(); ++i) {
    for (std::size_t j = i + 1; j < files.size(); ++j) {
      const NamedFile& a = files[i];
      const NamedFile& b = files[j];
      const bool written = a.use == NamedFile::Use::written || b.use == NamedFile::Use::written;
      if (!written || a.path.empty() || b.path.empty() || !same(a.path, b.path)) continue;
      if (a.path == b.path)
        return a.option + " and " + b.option + " are the same file, " + a.path.string();
      return a.option + " " + a.path.string() + " and " + b.option + " " + b.path.string() +
             " are the same file";
    }
  }
  return {};
}

}  // namespace sprag
