// Edits the text of a scene file; comments, order and spacing are kept.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

/// A key as error messages name it ("beam.damping", "contact.2.position", "system.K.1.2", entries
/// counted from 1), and its value: a number, an array, or an array of rows.
struct SceneValue {
  std::string path;
  std::vector<double> numbers;
  bool array = false;
  std::size_t columns = 0;  ///< of an array of rows; else 0
};

/// The text with these values. A missing key is appended to its table. A missing table is appended
/// to the text; it must not belong to an array of tables. `file` is the name in errors. Throws
/// SceneError.
std::string with_values(std::string_view text, const std::vector<SceneValue>& values,
                        const std::string& file);

/// The text with the names of matrix and vector files, which are relative to the folder `from`,
/// made relative to the folder `to`. Throws SceneError.
std::string with_files_from(std::string_view text, const std::filesystem::path& from,
                            const std::filesystem::path& to, const std::string& file);

/// The text without a table of the root: without its header, its keys and the comments between
/// them, its sub-tables, and dotted keys of the root. Comments after its last key are kept.
std::string without_table(std::string_view text, std::string_view table);

/// `text` as a TOML string, in quotes.
std::string in_quotes(std::string_view text);

/// Whether the text has this key or table.
bool has_key(std::string_view text, std::string_view path, const std::string& file);

/// Whether the value is a string: the name of a file of a matrix or a vector.
bool is_text(std::string_view text, std::string_view path, const std::string& file);

/// The number of this key, or `fallback` without that key. Throws SceneError.
double number_of(std::string_view text, std::string_view path, double fallback,
                 const std::string& file);

}  // namespace sprag
