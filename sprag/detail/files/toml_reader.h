// Checked access to a TOML text, for the readers of scene and study files. Every failure is a
// SceneError that reads "file:line:column: key is value; must be ...", with the dotted path of the
// key; entries count from 1.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

// toml++ asserts conditions that it reports as errors a few lines later: "[^]" would abort a debug
// build, and a release build with clang would assume that it cannot occur. Without NDEBUG toml++
// passes every such condition to TOML_ASSERT, a macro that its users may define.
#pragma push_macro("NDEBUG")
#undef NDEBUG
#define TOML_ASSERT(expr) static_assert(true)
#include <toml++/toml.h>
#pragma pop_macro("NDEBUG")

namespace sprag {

/// The range of numbers that a key accepts; all are finite.
struct Limits {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool without_low = false;  ///< `low` itself is excluded
};
inline constexpr Limits any_number{};
inline constexpr Limits positive{.low = 0.0, .without_low = true};
inline constexpr Limits not_negative{.low = 0.0};

/// Shortest text that reads back as the same double; used for numbers in messages.
std::string to_text(double value);
/// A computed number in a message, with five significant digits.
std::string rounded(double value);

/// End of the string or comment that begins at text[i]; i + 1 if none begins there.
std::size_t end_of_token(std::string_view text, std::size_t i);

using TomlKeys = std::initializer_list<std::string_view>;

/// Origin of a text, and remarks about it for the user.
struct TomlSource {
  std::string file;                   ///< the name in errors
  std::filesystem::path folder = {};  ///< names of other files in the text are relative to it
  std::vector<std::string> remarks = {};
};

/// A table of a document, which must outlive it. Getters throw SceneError.
class TomlTable {
 public:
  /// Rejects keys other than `keys`, with the nearest of them as a suggestion.
  TomlTable(const toml::table& table, std::string path, TomlSource& source, TomlKeys keys);

  bool has(std::string_view key) const { return table_->contains(key); }

  double number(std::string_view key, const Limits& limits) const;
  double number_or(std::string_view key, double fallback, const Limits& limits) const;
  /// The same for a value whose dotted path is `path`.
  double number_at(const toml::node& node, const std::string& path, const Limits& limits) const;
  int integer(std::string_view key, int low, int high) const;
  bool boolean_or(std::string_view key, bool fallback) const;
  std::string required_string(std::string_view key) const;
  std::string string_or(std::string_view key, const std::string& fallback) const;
  /// One of `options`; the first if the key is absent.
  std::string_view choice(std::string_view key, TomlKeys options) const;
  /// An array of numbers, or the name of a file that contains them as a row or a column.
  Eigen::VectorXd vector(std::string_view key) const;
  /// A number, or a value as for vector().
  Eigen::VectorXd numbers(std::string_view key) const;
  /// An array of strings.
  std::vector<std::string> strings(std::string_view key) const;
  /// An array of rows, or the name of a file that contains them (matrix_file.h). Must be square and
  /// symmetric within rounding; returned exactly symmetric, with a remark if it was not.
  Eigen::MatrixXd symmetric_matrix(std::string_view key) const;

  std::optional<TomlTable> table(std::string_view key, TomlKeys keys) const;
  /// The same without a check of its keys.
  std::optional<TomlTable> open_table(std::string_view key) const;
  /// A table inside this one, whose dotted path is `path`.
  TomlTable inside(const toml::table& table, std::string path, TomlKeys keys) const;
  const toml::table& contents() const { return *table_; }
  /// An array of tables, named key[1], key[2], ...; empty if the key is absent.
  std::vector<TomlTable> tables(std::string_view key, TomlKeys keys) const;

  /// Throws "file:line:column: path.key `message`", at the key's value (at the table if absent).
  [[noreturn]] void fail(std::string_view key, const std::string& message) const;
  /// The same at entry `i`, from 0, of the array: "path.key[i + 1]`message`".
  [[noreturn]] void fail(std::string_view key, std::size_t i, const std::string& message) const;
  /// Throws "file:line:column: `message`", at the table.
  [[noreturn]] void fail_here(const std::string& message) const;
  /// Throws "file:line:column: `message`".
  [[noreturn]] void fail_at(const toml::source_position& position,
                            const std::string& message) const;
  /// Throws "file:line:column: `path` is a ...; must be `wanted`", at the value.
  [[noreturn]] void fail_type(const toml::node& node, const std::string& path,
                              std::string_view wanted) const;
  /// The path of a file that the string at `key` names.
  std::filesystem::path file(std::string_view key) const {
    return source_->folder / required_string(key);
  }
  /// Adds a remark for the user: "path.key `message`".
  void remark(std::string_view key, const std::string& message) const {
    source_->remarks.push_back(path_of(key) + " " + message);
  }
  /// The key's dotted path.
  std::string path_of(std::string_view key) const;

 private:
  TomlTable(const toml::table& table, std::string path, TomlSource& source)
      : table_(&table), path_(std::move(path)), source_(&source) {}
  /// Throws "file:line:column: missing key path.key", at the table, if the key is absent.
  const toml::node& required(std::string_view key) const;
  const toml::array& checked_array(const toml::node& node, const std::string& path,
                                   std::string_view wanted) const;
  Eigen::VectorXd checked_vector(const toml::node& node, const std::string& path) const;
  Eigen::MatrixXd checked_matrix(const toml::node& node, const std::string& path) const;
  Eigen::MatrixXd of_file(const toml::node& node, const std::string& path) const;
  void refuse_unknown_keys(TomlKeys keys) const;

  const toml::table* table_;
  std::string path_;
  TomlSource* source_;
};

/// A parsed text. Throws SceneError.
class TomlDocument {
 public:
  TomlDocument(std::string_view text, TomlSource source);
  TomlTable root(TomlKeys keys) { return {table_, "", source_, keys}; }
  /// A table of this document, whose dotted path is `path`.
  TomlTable at(const toml::table& table, const std::string& path, TomlKeys keys) {
    return {table, path, source_, keys};
  }
  const toml::table& table() const { return table_; }
  /// Throws "file:line:column: `message`".
  [[noreturn]] void fail(const toml::source_position& position, const std::string& message) const;
  const std::vector<std::string>& remarks() const { return source_.remarks; }
  /// Existing files that strings of the document name, whether or not they will be read. The value
  /// of a key `name` is not a file name.
  std::vector<std::filesystem::path> files() const;

 private:
  TomlSource source_;
  toml::table table_;
};

}  // namespace sprag
