// The text of a scene file with other numbers in it: comments, order and spacing stay.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

/// A key, as errors name it ("beam.damping", "contact.2.position", "system.K.1.2"), entries
/// counting from 1, and its value: a number, or an array, or one of rows.
struct SceneValue {
  std::string path;
  std::vector<double> numbers;
  bool array = false;
  std::size_t columns = 0;  ///< of an array of rows; else 0
};

/// Where a key is not there yet it is added to its table, and the table, which then must not be
/// one of an array, to the end. `file` is the name that errors carry. Throws SceneError.
std::string with_values(std::string_view text, const std::vector<SceneValue>& values,
                        const std::string& file);

/// The text with the names of files of matrices and vectors, which are relative to the folder
/// `from`, as seen from the folder `to`. Throws SceneError.
std::string with_files_from(std::string_view text, const std::filesystem::path& from,
                            const std::filesystem::path& to, const std::string& file);

/// The text without a table of the root: its header, its keys and the comments between them, its
/// sub-tables, and dotted keys of the root. Comments after its last key stay.
std::string without_table(std::string_view text, std::string_view table);

/// `text` as a TOML string, in quotes.
std::string in_quotes(std::string_view text);

/// Whether the text has this key or table.
bool has_key(std::string_view text, std::string_view path, const std::string& file);

/// Whether it is given by a name: a file of a matrix or a vector.
bool is_text(std::string_view text, std::string_view path, const std::string& file);

/// The number of this key, or `fallback` where it is not there. Throws SceneError.
double number_of(std::string_view text, std::string_view path, double fallback,
                 const std::string& file);

}  // namespace sprag
