// Reads a matrix of real numbers from a text file. Formats: Matrix Market (.mtx: Boisvert, Pozo &
// Remington, NISTIR 5935, 1996), dense or coordinates, general or symmetric; or rows of numbers,
// separated by commas, semicolons, tabs or blanks, with comment lines that begin with # or %.
#pragma once

#include <Eigen/Core>
#include <filesystem>

namespace sprag {

/// Coordinate entries that are given twice are added. `largest` limits rows and columns. Throws
/// SceneError (scene_file.h), "FILE:LINE:COLUMN: message". Throws InputError (input_file.h) for a
/// file that cannot be read, is larger than 1 GiB, or is not a regular file, since a pipe may be
/// endless.
Eigen::MatrixXd read_matrix_file(const std::filesystem::path& file, Eigen::Index largest = 5000);

}  // namespace sprag
