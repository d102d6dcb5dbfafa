#include "sprag/detail/files/toml_reader.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/matrix_file.h"
#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/files/unsupported_key.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

SceneError error_at(const std::string& file, const toml::source_position& position,
                    const std::string& message) {
  if (!position) return {file, message};
  return {file, static_cast<int>(position.line), static_cast<int>(position.column), message};
}

// Number of consecutive `c` at text[i].
std::size_t run_of(char c, std::string_view text, std::size_t i) {
  return std::min(text.find_first_not_of(c, i), text.size()) - i;
}

[[noreturn]] void fail_at_byte(std::string_view text, std::size_t i, const std::string& file,
                               const std::string& message) {
  const std::string_view before = text.substr(0, i);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t newline = before.rfind('\n');
  const std::size_t column = newline == std::string_view::npos ? i + 1 : i - newline;
  throw SceneError(file, static_cast<int>(line), static_cast<int>(column), message);
}

// Rejects texts on which toml++ 3 fails. Its behaviour is undefined for non-ASCII characters
// outside of strings and comments. It recurses into nested values and the parts of dotted keys,
// which can overflow the stack; here a table is nested at most max_key_parts * (max_nesting + 1)
// deep.
constexpr int max_key_parts = 32;
constexpr int max_nesting = 32;

void refuse_dangerous(std::string_view text, const std::string& file) {
  const std::string most_parts = std::to_string(max_key_parts);
  const std::string most_nesting = std::to_string(max_nesting);
  int parts = 1;  // of the present key, or number
  int nesting = 0;
  for (std::size_t i = 0; i < text.size(); i = end_of_token(text, i)) {
    const char c = text[i];
    if (i == 0 && text.starts_with("\xEF\xBB\xBF")) {  // a byte order mark
      i = 2;
    } else if (static_cast<unsigned char>(c) >= 0x80) {
      fail_at_byte(text, i, file,
                   "a character beyond ASCII; may only be in a comment or between quotes");
    } else if (c == '.') {
      if (++parts <= max_key_parts) continue;
      fail_at_byte(text, i, file,
                   "a key has more than " + most_parts + " parts between dots; must have at most " +
                       most_parts);
    } else if (c == '[' || c == '{') {
      parts = 1;
      if (++nesting <= max_nesting) continue;
      fail_at_byte(text, i, file,
                   "brackets are nested more than " + most_nesting + " deep; must be at most " +
                       most_nesting);
    } else if (c == ']' || c == '}') {
      parts = 1;
      nesting = std::max(nesting - 1, 0);
    } else if (c == '=' || c == ',' || c == '\n') {
      parts = 1;
    }
  }
}

std::string_view type_name(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table:
      return "a table";
    case toml::node_type::array:
      return node.as_array()->is_homogeneous<toml::table>() ? "an array of tables" : "an array";
    case toml::node_type::string:
      return "a string";
    case toml::node_type::integer:
      return "an integer";
    case toml::node_type::floating_point:
      return "a float";
    case toml::node_type::boolean:
      return "a boolean";
    case toml::node_type::date:
      return "a date";
    case toml::node_type::time:
      return "a time";
    case toml::node_type::date_time:
      return "a date-time";
    case toml::node_type::none:
      break;
  }
  return "nothing";
}

std::string described(const Limits& limits) {
  if (std::isfinite(limits.high)) {
    return (limits.without_low ? "in (" : "in [") + to_text(limits.low) + ", " +
           to_text(limits.high) + "]";
  }
  return (limits.without_low ? "> " : ">= ") + to_text(limits.low);
}

std::string entry(const std::string& path, std::size_t index) {
  return path + "[" + std::to_string(index + 1) + "]";
}

std::string listed(TomlKeys words, std::string_view last_separator, std::string_view quote) {
  std::string text;
  for (const std::string_view* word = words.begin(); word != words.end(); ++word) {
    if (word != words.begin()) text += word + 1 == words.end() ? last_separator : ", ";
    text += quote;
    text += *word;
    text += quote;
  }
  return text;
}

bool precedes(const toml::source_position& a, const toml::source_position& b) {
  return std::pair(a.line, a.column) < std::pair(b.line, b.column);
}

void add_files(const toml::node& node, const std::filesystem::path& folder,
               std::vector<std::filesystem::path>& files) {
  if (const toml::table* table = node.as_table()) {
    for (const auto& [key, value] : *table) {
      if (key != "name") add_files(value, folder, files);
    }
  } else if (const toml::array* array = node.as_array()) {
    for (const toml::node& entry : *array) add_files(entry, folder, files);
  } else if (const auto* text = node.as_string()) {
    std::error_code error;
    const std::filesystem::path file = folder / text->get();
    if (std::filesystem::is_regular_file(file, error)) files.push_back(file);
  }
}

}  // namespace

std::size_t end_of_token(std::string_view text, std::size_t i) {
  const char c = text[i];
  if (c == '#') return std::min(text.find('\n', i), text.size());
  if (c != '"' && c != '\'') return i + 1;
  const std::size_t quotes = run_of(c, text, i);
  if (quotes == 2) return i + 2;  // an empty string
  const bool long_string = quotes >= 3;
  const std::size_t closing = long_string ? 3 : 1;
  for (i += closing; i < text.size(); ++i) {
    if (text[i] == '\n' && !long_string) return i;  // unterminated; the parser reports it
    if (text[i] == '\\' && c == '"') {
      ++i;
    } else if (text[i] == c && run_of(c, text, i) >= closing) {
      return i + closing;
    }
  }
  return text.size();
}

std::string to_text(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

std::string rounded(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                 std::chars_format::general, 5)
                       .ptr;
  return {buffer.data(), end};
}

TomlDocument::TomlDocument(std::string_view text, TomlSource source) : source_(std::move(source)) {
  refuse_dangerous(text, source_.file);
  try {
    table_ = toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw error_at(source_.file, error.source().begin, std::string(error.description()));
  }
}

void TomlDocument::fail(const toml::source_position& position, const std::string& message) const {
  throw error_at(source_.file, position, message);
}

std::vector<std::filesystem::path> TomlDocument::files() const {
  std::vector<std::filesystem::path> files;
  add_files(table_, source_.folder, files);
  return files;
}

TomlTable::TomlTable(const toml::table& table, std::string path, TomlSource& source, TomlKeys keys)
    : table_(&table), path_(std::move(path)), source_(&source) {
  refuse_unknown_keys(keys);
}

void TomlTable::refuse_unknown_keys(TomlKeys keys) const {
  const toml::key* first = nullptr;
  for (const auto& [key, node] : *table_) {
    if (std::find(keys.begin(), keys.end(), key.str()) != keys.end()) continue;
    if (!first || precedes(key.source().begin, first->source().begin)) first = &key;
  }
  if (!first) return;
  if (const auto limit = unsupported_key(path_, first->str())) {
    fail_at(first->source().begin, path_of(first->str()) + " " + *limit);
  }
  const std::optional<std::string_view> suggestion =
      nearest_word(first->str(), {keys.begin(), keys.size()});
  const std::string path = path_.empty() ? "" : path_ + ".";
  fail_at(first->source().begin,
          "unknown key " + path + std::string(first->str()) +
              (suggestion ? "; did you mean " + std::string(*suggestion) + "?"
                          : "; must be one of " + listed(keys, ", ", "")));
}

double TomlTable::number(std::string_view key, const Limits& limits) const {
  return number_at(required(key), path_of(key), limits);
}

double TomlTable::number_or(std::string_view key, double fallback, const Limits& limits) const {
  return has(key) ? number(key, limits) : fallback;
}

int TomlTable::integer(std::string_view key, int low, int high) const {
  const toml::node& node = required(key);
  const auto* integer = node.as_integer();
  if (!integer) fail_type(node, path_of(key), "an integer");
  const std::int64_t value = integer->get();
  if (value < low || value > high) {
    fail(key, "is " + std::to_string(value) + "; must be in " + std::to_string(low) + ".." +
                  std::to_string(high));
  }
  return static_cast<int>(value);
}

bool TomlTable::boolean_or(std::string_view key, bool fallback) const {
  if (!has(key)) return fallback;
  const toml::node& node = required(key);
  if (!node.is_boolean()) fail_type(node, path_of(key), "true or false");
  return node.as_boolean()->get();
}

std::string TomlTable::string_or(std::string_view key, const std::string& fallback) const {
  return has(key) ? required_string(key) : fallback;
}

std::string TomlTable::required_string(std::string_view key) const {
  const toml::node& node = required(key);
  if (!node.is_string()) fail_type(node, path_of(key), "a string");
  return node.as_string()->get();
}

std::string_view TomlTable::choice(std::string_view key, TomlKeys options) const {
  const std::string given = string_or(key, std::string(*options.begin()));
  const auto* option = std::find(options.begin(), options.end(), given);
  if (option == options.end()) {
    fail(key, "is \"" + given + "\"; must be " + listed(options, " or ", "\""));
  }
  return *option;
}

Eigen::VectorXd TomlTable::vector(std::string_view key) const {
  return checked_vector(required(key), path_of(key));
}

Eigen::VectorXd TomlTable::numbers(std::string_view key) const {
  const toml::node& node = required(key);
  if (node.is_array() || node.is_string()) return checked_vector(node, path_of(key));
  return Eigen::VectorXd::Constant(1, number_at(node, path_of(key), any_number));
}

std::vector<std::string> TomlTable::strings(std::string_view key) const {
  const toml::array& array = checked_array(required(key), path_of(key), "an array of strings");
  std::vector<std::string> strings;
  for (std::size_t i = 0; i < array.size(); ++i) {
    if (!array[i].is_string()) fail_type(array[i], entry(path_of(key), i), "a string");
    strings.push_back(array[i].as_string()->get());
  }
  return strings;
}

Eigen::MatrixXd TomlTable::symmetric_matrix(std::string_view key) const {
  const toml::node& node = required(key);
  const std::string path = path_of(key);
  const Eigen::MatrixXd matrix =
      node.is_string() ? of_file(node, path) : checked_matrix(node, path);
  const std::string given = node.is_string() ? " (" + node.as_string()->get() + ")" : "";
  if (matrix.rows() != matrix.cols()) {
    fail(key, "is " + std::to_string(matrix.rows()) + " x " + std::to_string(matrix.cols()) +
                  given + "; must be square");
  }
  const double rounding = 1e-12 * matrix.cwiseAbs().maxCoeff();
  double largest = 0.0;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      const double difference = std::abs(matrix(i, j) - matrix(j, i));
      largest = std::max(largest, difference);
      if (difference <= rounding) continue;
      const auto [row, column] =
          std::pair(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
      const toml::node& at =
          node.is_string() ? node : (*(*node.as_array())[row].as_array())[column];
      fail_at(at.source().begin, entry(entry(path, row), column) + " is " + to_text(matrix(i, j)) +
                                     given + "; must be " + to_text(matrix(j, i)) + ", as " +
                                     entry(entry(path, column), row) + " (symmetric)");
    }
  }
  if (largest > 0.0) {
    const std::string what = path + given + " is symmetric but for rounding (" + to_text(largest) +
                             "); the mean of it and its transpose is taken";
    source_->remarks.emplace_back(error_at(source_->file, node.source().begin, what).what());
  }
  return 0.5 * matrix + 0.5 * matrix.transpose();
}

std::optional<TomlTable> TomlTable::table(std::string_view key, TomlKeys keys) const {
  std::optional<TomlTable> found = open_table(key);
  if (found) found->refuse_unknown_keys(keys);
  return found;
}

std::optional<TomlTable> TomlTable::open_table(std::string_view key) const {
  if (!has(key)) return std::nullopt;
  const toml::node& node = required(key);
  if (!node.is_table()) fail_type(node, path_of(key), "a table");
  return TomlTable(*node.as_table(), path_of(key), *source_);
}

TomlTable TomlTable::inside(const toml::table& table, std::string path, TomlKeys keys) const {
  return {table, std::move(path), *source_, keys};
}

std::vector<TomlTable> TomlTable::tables(std::string_view key, TomlKeys keys) const {
  std::vector<TomlTable> result;
  if (!has(key)) return result;
  const std::string path = path_of(key);
  const toml::array& array =
      checked_array(required(key), path, "an array of tables, [[" + std::string(key) + "]]");
  for (std::size_t i = 0; i < array.size(); ++i) {
    if (!array[i].is_table()) fail_type(array[i], entry(path, i), "a table");
    result.emplace_back(*array[i].as_table(), entry(path, i), *source_, keys);
  }
  return result;
}

void TomlTable::fail(std::string_view key, const std::string& message) const {
  const toml::node* node = table_->get(key);
  fail_at((node ? *node : *table_).source().begin, path_of(key) + " " + message);
}

void TomlTable::fail(std::string_view key, std::size_t i, const std::string& message) const {
  const toml::array& array = *required(key).as_array();
  fail_at(array[i].source().begin, entry(path_of(key), i) + message);
}

void TomlTable::fail_here(const std::string& message) const {
  fail_at(table_->source().begin, message);
}

std::string TomlTable::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

const toml::node& TomlTable::required(std::string_view key) const {
  if (!has(key)) fail_here("missing key " + path_of(key));
  return *table_->get(key);
}

double TomlTable::number_at(const toml::node& node, const std::string& path,
                            const Limits& limits) const {
  const toml::source_position position = node.source().begin;
  if (!node.is_number()) fail_type(node, path, "a number");
  const double value = node.is_integer() ? static_cast<double>(node.as_integer()->get())
                                         : node.as_floating_point()->get();
  if (!std::isfinite(value)) fail_at(position, path + " is " + to_text(value) + "; must be finite");
  if (value < limits.low || value > limits.high || (limits.without_low && value == limits.low)) {
    fail_at(position, path + " is " + to_text(value) + "; must be " + described(limits));
  }
  return value;
}

const toml::array& TomlTable::checked_array(const toml::node& node, const std::string& path,
                                            std::string_view wanted) const {
  if (!node.is_array()) fail_type(node, path, wanted);
  return *node.as_array();
}

Eigen::VectorXd TomlTable::checked_vector(const toml::node& node, const std::string& path) const {
  if (node.is_string()) {
    const Eigen::MatrixXd matrix = of_file(node, path);
    if (matrix.rows() != 1 && matrix.cols() != 1) {
      fail_at(node.source().begin, path + " is " + std::to_string(matrix.rows()) + " x " +
                                       std::to_string(matrix.cols()) + " (" +
                                       node.as_string()->get() +
                                       "); must be one row or one column");
    }
    return matrix.reshaped();
  }
  const toml::array& array = checked_array(node, path, "an array of numbers");
  Eigen::VectorXd vector(static_cast<Eigen::Index>(array.size()));
  for (std::size_t i = 0; i < array.size(); ++i) {
    vector(static_cast<Eigen::Index>(i)) = number_at(array[i], entry(path, i), any_number);
  }
  return vector;
}

Eigen::MatrixXd TomlTable::checked_matrix(const toml::node& node, const std::string& path) const {
  const toml::array& rows = checked_array(node, path, "an array of rows of numbers");
  const auto size = static_cast<Eigen::Index>(rows.size());
  if (size == 0) fail_at(node.source().begin, path + " is empty; must have at least one row");
  Eigen::MatrixXd matrix(size, size);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Eigen::VectorXd row = checked_vector(rows[i], entry(path, i));
    if (row.size() != size) {
      fail_at(rows[i].source().begin, entry(path, i) + " has size " + std::to_string(row.size()) +
                                          "; must be " + std::to_string(size) +
                                          ", the number of rows");
    }
    matrix.row(static_cast<Eigen::Index>(i)) = row;
  }
  return matrix;
}

Eigen::MatrixXd TomlTable::of_file(const toml::node& node, const std::string& path) const {
  const std::filesystem::path file = source_->folder / node.as_string()->get();
  try {
    return read_matrix_file(file);
  } catch (const SceneError& error) {
    const std::string message = error.message + " (" + path + ")";
    if (error.line == 0) throw SceneError(error.file, message);
    throw SceneError(error.file, error.line, error.column, message);
  } catch (const InputError& error) {
    fail_at(node.source().begin, path + " names a file: " + error.what());
  }
}

void TomlTable::fail_type(const toml::node& node, const std::string& path,
                          std::string_view wanted) const {
  fail_at(node.source().begin,
          path + " is " + std::string(type_name(node)) + "; must be " + std::string(wanted));
}

void TomlTable::fail_at(const toml::source_position& position, const std::string& message) const {
  throw error_at(source_->file, position, message);
}

}  // namespace sprag
