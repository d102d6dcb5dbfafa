// Lines, fields and numbers of CSV files: comma-separated, no quotes, one header line. Numbers have
// 17 significant digits, so that a double read back is the double that was written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/input_file.h"

namespace sprag {

/// A place in a text file where something is wrong.
struct FileProblem {
  std::size_t line;  ///< from 1
  std::string what;
};

void append_number(std::string& text, double value);
void append_number(std::string& text, std::int64_t value);

/// The field as a finite double or an integer, blanks around it and a plus sign allowed; nothing if
/// it is not one.
std::optional<double> parse_double(std::string_view field);
std::optional<std::int64_t> parse_integer(std::string_view field);

/// The fields of a line, one more than it has commas.
void split_fields(std::string_view line, std::vector<std::string_view>& fields);

/// Reads a text file line by line. LF and CRLF end a line, or CR where it ends the first one. A
/// UTF-8 byte order mark before the first line is passed over.
class LineReader {
 public:
  /// Throws InputError if the file cannot be opened.
  explicit LineReader(const std::filesystem::path& file) : LineReader(InputFile(file)) {}
  explicit LineReader(InputFile file) : file_(std::move(file)) {}

  /// truncated: a last line without an end, which may have been cut in the middle of a number.
  enum class Result { line, end, truncated, too_long, unreadable };

  /// `line` is valid until the next call. Every result but `line` is final.
  Result next(std::string_view& line);

  /// Number of the line that next() looked at last, from 1.
  std::size_t number() const { return number_; }

 private:
  std::size_t find(std::string_view characters, std::string_view& bytes);
  void find_end_of_line();

  InputFile file_;
  std::string_view end_of_line_;
  std::size_t shown_ = 0;  // bytes of the line that next() returned last
  std::size_t number_ = 0;
};

/// What is wrong with a line that is not Result::line, for a FileProblem.
std::string describe(LineReader::Result result);

}  // namespace sprag
