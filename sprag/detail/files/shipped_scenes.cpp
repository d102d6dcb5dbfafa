#include "sprag/detail/files/shipped_scenes.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "sprag/detail/files/nearest_word.h"

namespace sprag {
namespace {

using std::filesystem::path;

constexpr std::string_view ending = ".toml";

bool is_name(const path& given) {
  const std::string text = given.string();
  if (text.empty() || text.find('/') != std::string::npos) return false;
  std::error_code error;
  const auto status = std::filesystem::status(given, error);
  return !std::filesystem::exists(status) || std::filesystem::is_directory(status);
}

std::string stem_of(const path& given) {
  std::string name = given.string();
  if (name.ends_with(ending)) name.resize(name.size() - ending.size());
  return name;
}

std::vector<std::string> names_in(const path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == ending) names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

// The best match by edit distance first, then names that contain the word; all names if there are
// neither.
std::vector<std::string> nearest(const std::string& word, const std::vector<std::string>& names) {
  std::vector<std::string> near;
  const std::vector<std::string_view> candidates(names.begin(), names.end());
  if (const auto best = nearest_word(word, candidates)) near.emplace_back(*best);
  for (const std::string& name : names) {
    const bool listed = !near.empty() && near.front() == name;
    if (!listed && name.find(word) != std::string::npos) near.push_back(name);
  }
  return near.empty() ? names : near;
}

}  // namespace

path shipped_scenes(const path& file) {
  std::error_code error;
  path above = std::filesystem::weakly_canonical(file, error);
  while (above.has_relative_path()) {
    above = above.parent_path();
    const path folder = above / SPRAG_DATA_DIR / "sprag" / "scenes";
    if (above.is_absolute() && is_directory(folder, error)) return canonical(folder, error);
  }
  return {};
}

path shipped_file(const std::string& name, const path& folder) {
  const std::vector<std::string> names = names_in(folder);
  const std::string stem = stem_of(name);
  if (std::find(names.begin(), names.end(), stem) == names.end()) return {};
  return folder / (stem + std::string(ending));
}

path find_scene(const path& given, const path& folder) {
  if (!is_name(given)) return given;
  const path shipped = shipped_file(given.string(), folder);
  return shipped.empty() ? given : shipped;
}

std::string scene_not_found(const path& given, const path& folder) {
  if (!is_name(given)) return {};
  const std::vector<std::string> names = names_in(folder);
  if (names.empty()) {
    return "no such file, and the scenes that come with Sprag are not installed beside this "
           "program";
  }
  std::string text = "no such file, and none of this name in " + folder.string() + "; ";
  const std::vector<std::string> near = nearest(stem_of(given), names);
  text += near == names ? "choose " : "did you mean ";
  for (std::size_t i = 0; i < near.size(); ++i) {
    if (i > 0) text += i + 1 < near.size() ? ", " : " or ";
    text += near[i];
  }
  return text + (near == names ? "" : "?");
}

}  // namespace sprag
