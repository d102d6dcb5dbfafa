// Reads a recorded signal from a text file: a header line with the names of the columns, then rows
// of numbers, separated by commas, semicolons, tabs or blanks. Numbers may have decimal commas if
// commas do not separate. Lines that begin with # or % are comments. A file of two columns may have
// no header.
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
  std::vector<double> t, values;
  std::string column;           ///< name of the signal's column; empty without a header
  bool decimal_commas = false;  ///< the numbers have decimal commas
};

/// Throws SceneError (scene_file.h), "FILE:LINE:COLUMN: message", for times that do not increase,
/// gaps, fields that are not finite numbers, missing columns and fewer than four samples. Throws
/// InputError (input_file.h) for a file that cannot be read.
Record read_record_file(const std::filesystem::path& file, const RecordColumns& columns);

}  // namespace sprag
