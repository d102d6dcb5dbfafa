// Text files with columns, as spreadsheets, loggers and scripts export them: CSV or TSV with a
// header line of names. Quoted fields, CRLF or CR, a UTF-8 byte order mark, blanks around fields,
// empty cells, empty lines and lines that start with # are ordinary.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace sprag {

/// What a row has that cannot be used.
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
  std::string_view text;  ///< without quotes and blanks around it; never empty
};

struct Column {
  std::string name;
  std::vector<Cell> cells;  ///< in the file's order, without the empty ones
};

struct ColumnFile {
  char separator = ',';  ///< comma, semicolon or tab
  std::vector<Column> columns;
  std::vector<RowProblem> problems;  ///< rows with a wrong number of fields or an open quote

  /// Index of the column. Throws InputError (sprag/detail/files/input_file.h), which lists the
  /// names that exist, if there is none or more than one of that name. `file` is the name that
  /// errors carry.
  std::size_t find(std::string_view name, const std::string& file) const;
};

/// "comma", "semicolon", "tab" or the character itself; nothing for anything else.
std::optional<char> parse_separator(std::string_view text);

/// Reads the columns of `text`, which must outlive them. Without `separator` it is the one of tab,
/// semicolon and comma that comes first in this order and stands in the header; a file with a
/// single column counts as separated by semicolons, so that its commas are decimal ones. `names`
/// are those of the columns of a file without a header, whose separator is then the one that makes
/// as many fields of its first line; empty: the first line is the header. Throws InputError if
/// there is no header line, or only numbers in it, or not as many columns as names; `file` is the
/// name that errors carry.
ColumnFile parse_columns(std::string_view text, const std::string& file,
                         std::optional<char> separator = std::nullopt,
                         const std::vector<std::string>& names = {});

}  // namespace sprag
