// Names with a value and a standard deviation each, in the format of messages: int32 n, n names, n
// values, n standard deviations.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/refusal.h"

namespace sprag {

struct NamedValues {
  std::vector<std::string> names;
  std::vector<double> values, sigmas;  ///< one per name; sigmas may be infinite
};

/// Reads int32 n and n names from the front of `rest`. Refuses more than 1000 names, and names of
/// more than 255 bytes.
Refusal take_names(std::span<const std::uint8_t>& rest, std::vector<std::string>& names);

/// Reads names, values and standard deviations from the front of `rest`. Refuses in addition values
/// that are not finite, and standard deviations that are negative or nan.
Refusal take_named_values(std::span<const std::uint8_t>& rest, NamedValues& named);

}  // namespace sprag
