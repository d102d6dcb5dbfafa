// Text files with columns, as exported by spreadsheets, loggers and scripts: CSV or TSV with a
// header line of names. Allowed are quoted fields, CRLF or CR, a UTF-8 byte order mark, blanks
// around fields, empty cells, empty lines, and comment lines that start with #.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

/// A part of a row that cannot be used.
struct RowProblem {
  std::size_t line;    ///< from 1
  std::string column;  ///< its name; empty: the whole row
  std::string what;
};

/// "line: column NAME: what" or "line: what".
std::string to_text(const RowProblem& problem);

/// 'NAME', for messages.
std::string quoted(const std::string& name);

struct Cell {
  std::size_t line;       ///< from 1
  std::string_view text;  ///< without surrounding quotes and blanks; never empty
};

struct Column {
  std::string name;
  std::vector<Cell> cells;  ///< nonempty cells in the file's order
};

struct ColumnFile {
  char separator = ',';  ///< comma, semicolon or tab
  std::vector<Column> columns;
  std::vector<RowProblem> problems;  ///< rows with a wrong number of fields or an open quote

  /// Index of the column. Throws InputError (sprag/detail/files/input_file.h) with the list of
  /// names if there is no column, or more than one, of that name. `file` is the name in errors.
  std::size_t find(std::string_view name, const std::string& file) const;
};

/// "comma", "semicolon", "tab" or the character itself; nullopt for any other text.
std::optional<char> parse_separator(std::string_view text);

/// Splits a line into its fields, without surrounding blanks and quotes. Returns false if a quote
/// is not closed.
bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields);

/// Reads the columns of `text`, which must outlive them. `separator`: if not specified, it is the
/// first of tab, semicolon and comma that occurs in the header. A file with a single column counts
/// as separated by semicolons, so that its commas are decimal commas. `names`: column names of a
/// file without a header; its separator is the one that splits the first line into as many fields.
/// Empty: the first line is the header. Throws InputError if there is no header line, if it
/// consists of numbers, or if the number of columns differs from that of names; `file` is the name
/// in errors.
ColumnFile parse_columns(std::string_view text, const std::string& file,
                         std::optional<char> separator = std::nullopt,
                         const std::vector<std::string>& names = {});

}  // namespace sprag
