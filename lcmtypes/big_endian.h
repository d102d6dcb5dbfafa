// Numbers in LCM's format on the wire and in logs: big-endian, doubles by their bits. liblcm's own
// inline functions read doubles through integer pointers, which violates strict aliasing; these do
// not. Callers must check sizes before.
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace sprag {

/// Writes `value` at `to` and moves `to` past it.
template <std::integral Integer>
void put(std::uint8_t*& to, Integer value) {
  const auto bits = static_cast<std::make_unsigned_t<Integer>>(value);
  for (std::size_t i = sizeof(Integer); i-- > 0;)
    *to++ = static_cast<std::uint8_t>(bits >> (8 * i));
}
inline void put(std::uint8_t*& to, double value) { put(to, std::bit_cast<std::uint64_t>(value)); }

/// Reads a value at `from` and moves `from` past it.
template <std::integral Integer>
Integer take(const std::uint8_t*& from) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(Integer); ++i) bits = bits << 8U | *from++;
  return static_cast<Integer>(static_cast<std::make_unsigned_t<Integer>>(bits));
}
template <std::same_as<double> Double>
Double take(const std::uint8_t*& from) {
  return std::bit_cast<double>(take<std::uint64_t>(from));
}

}  // namespace sprag
