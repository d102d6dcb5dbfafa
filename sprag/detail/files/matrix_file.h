// A matrix of real numbers from a text file, as programs of numerics write them: Matrix Market
// (.mtx: Boisvert, Pozo & Remington, NISTIR 5935, 1996), dense or coordinates, general or
// symmetric; else rows of numbers, separated by commas, semicolons, tabs or blanks, where lines
// that begin with # or % are comments.
#pragma once

#include <Eigen/Core>
#include <filesystem>

namespace sprag {

/// Entries of coordinates that are given twice are added. `largest`: rows and columns that a matrix
/// may have. Throws SceneError (scene_file.h), which reads "FILE:LINE:COLUMN: what is wrong", and
/// InputError (input_file.h) for a file that cannot be read, is larger than 1 GiB, or is not a
/// regular file: a pipe may never have an end.
Eigen::MatrixXd read_matrix_file(const std::filesystem::path& file, Eigen::Index largest = 5000);

}  // namespace sprag
