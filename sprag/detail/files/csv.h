// Lines, fields and numbers of CSV files: comma-separated, without quotes, one header line. Numbers
// are written with 17 significant digits, so that reading gives the same double. Also fields and
// words of other text files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/files/input_file.h"
#include "sprag/error.h"

namespace sprag {

void append_number(std::string& text, double value);
void append_number(std::string& text, std::int64_t value);

/// The field as a finite double, or as an integer; nullopt if it is none. Blanks around it and a
/// plus sign are allowed.
std::optional<double> parse_double(std::string_view field);
std::optional<std::int64_t> parse_integer(std::string_view field);

/// Splits a line at its commas, or at another separator.
void split_fields(std::string_view line, std::vector<std::string_view>& fields,
                  char separator = ',');
/// Splits a line at any number of blanks.
void split_words(std::string_view line, std::vector<std::string_view>& words,
                 std::string_view blanks = " \t");

/// The text without blanks around it.
std::string_view trimmed(std::string_view text, std::string_view blanks = " \t");

/// ASCII letters in lower case.
std::string lower_case(std::string_view text);

/// Reads a text file line by line. Lines end with LF or CRLF, or with CR if the first line does. A
/// UTF-8 byte order mark before the first line is skipped.
class LineReader {
 public:
  /// Throws InputError if the file cannot be opened.
  explicit LineReader(const std::filesystem::path& file) : LineReader(InputFile(file)) {}
  explicit LineReader(InputFile file) : file_(std::move(file)) {}

  /// truncated: the last line has no end of line, so it may have been cut in the middle of a
  /// number.
  enum class Result { line, end, truncated, too_long, unreadable };

  /// `line` is valid until the next call. Every result but `line` is final.
  Result next(std::string_view& line);

  /// Number of the line that next() read last, from 1.
  std::size_t number() const { return number_; }

 private:
  std::size_t find(std::string_view characters, std::string_view& bytes);
  void find_end_of_line();

  InputFile file_;
  std::string_view end_of_line_;
  std::size_t shown_ = 0;  // bytes of the line that next() returned last, to be skipped
  std::size_t number_ = 0;
};

/// Text for a FileProblem about a result other than Result::line.
std::string describe(LineReader::Result result);

}  // namespace sprag
