// The base of all errors that the library throws, but for std::invalid_argument where a call makes
// no sense.
#pragma once

#include <stdexcept>

namespace sprag {

struct Error : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace sprag
