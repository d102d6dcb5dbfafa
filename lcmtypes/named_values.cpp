#include "lcmtypes/named_values.h"

#include <cmath>
#include <cstddef>

#include "lcmtypes/big_endian.h"

namespace sprag {
namespace {

constexpr std::int32_t most_names = 1000;
constexpr std::int32_t longest_named = 256;  // including the final zero

Refusal take_name(std::span<const std::uint8_t>& rest, std::string& name) {
  if (rest.size() < 4) return Refusal::truncated;
  const std::uint8_t* from = rest.data();
  const auto size = take<std::int32_t>(from);
  if (size < 1 || size > longest_named) return Refusal::bad_count;
  const auto length = static_cast<std::size_t>(size) - 1;
  if (rest.size() < 4 + length + 1) return Refusal::truncated;
  if (from[length] != 0) return Refusal::bad_value;
  name.assign(from, from + length);
  rest = rest.subspan(4 + length + 1);
  return Refusal::none;
}

}  // namespace

Refusal take_names(std::span<const std::uint8_t>& rest, std::vector<std::string>& names) {
  if (rest.size() < 4) return Refusal::truncated;
  const std::uint8_t* from = rest.data();
  const auto n = take<std::int32_t>(from);
  if (n < 0 || n > most_names) return Refusal::bad_count;
  rest = rest.subspan(4);
  names.resize(static_cast<std::size_t>(n));
  for (std::string& name : names) {
    const Refusal refusal = take_name(rest, name);
    if (refusal != Refusal::none) return refusal;
  }
  return Refusal::none;
}

Refusal take_named_values(std::span<const std::uint8_t>& rest, NamedValues& named) {
  const Refusal of_names = take_names(rest, named.names);
  if (of_names != Refusal::none) return of_names;
  const std::size_t count = named.names.size();
  named.values.resize(count);
  named.sigmas.resize(count);
  if (rest.size() < 16 * count) return Refusal::truncated;
  const std::uint8_t* from = rest.data();
  bool possible = true;
  for (double& value : named.values) {
    value = take<double>(from);
    possible = possible && std::isfinite(value);
  }
  for (double& sigma : named.sigmas) {
    sigma = take<double>(from);
    possible = possible && sigma >= 0.0;
  }
  rest = rest.subspan(16 * count);
  return possible ? Refusal::none : Refusal::bad_value;
}

}  // namespace sprag
