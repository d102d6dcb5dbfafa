// Reads a recorded signal from a text file: lines of a recorder, a header line with the names of
// the columns, a row of their units, then rows of numbers, separated by commas, semicolons, tabs or
// blanks; a file of two columns may have rows alone. Numbers may have decimal commas if commas do
// not separate. Lines that begin with # or % are comments. Times are in s, or in the ms, us or ns
// that their column's name or unit says.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sprag {

/// Names of columns; empty: the first column is the time, and the only other one the signal.
struct RecordColumns {
  std::string time, signal;
};

struct Record {
  std::vector<double> t, values;     ///< times [s], and the signal in the file's unit
  std::string column;                ///< name of the signal's column; empty without a header
  std::vector<std::string> remarks;  ///< what was guessed or left out: "has times in ms, ..."
};

/// Throws SceneError (scene_file.h), "FILE:LINE:COLUMN: message", for times that do not increase,
/// gaps, fields that are not finite numbers, missing columns and fewer than four samples. Throws
/// InputError (input_file.h) for a file that cannot be read.
Record read_record_file(const std::filesystem::path& file, const RecordColumns& columns);

}  // namespace sprag
