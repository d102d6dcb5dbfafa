// Names with a value and a standard deviation each, as messages carry them: int32 n, n names, n
// values, n deviations.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lcmtypes/refusal.h"

namespace sprag {

struct NamedValues {
  std::vector<std::string> names;
  std::vector<double> values, sigmas;  ///< one each; sigmas may be infinite
};

/// Takes int32 n and n names from the front of `rest`. Refused: more than 1000, names of more than
/// 255 bytes.
Refusal take_names(std::span<const std::uint8_t>& rest, std::vector<std::string>& names);

/// Takes them from the front of `rest`. Refused: more than 1000, names of more than 255 bytes,
/// values that are not finite, deviations that are negative or no numbers.
Refusal take_named_values(std::span<const std::uint8_t>& rest, NamedValues& named);

}  // namespace sprag
