/// \file
/// \brief Base class of the library's errors about machines, scenes and files.
///
/// Functions throw std::invalid_argument for an argument outside of its range, and Interrupted
/// where a std::stop_token asks them to stop. These two do not derive from Error.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>

namespace sprag {

/// \brief An error about a machine, a scene or a file; what() is a sentence for people.
struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// \brief A problem at a line of a text file.
struct FileProblem {
  std::size_t line;  ///< from 1
  std::string what;  ///< for people
};

}  // namespace sprag
