// What all that uses the bus and recordings has in common.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "lcmtypes/key.h"

namespace sprag::python {

namespace py = pybind11;

using Bytes = std::span<const std::uint8_t>;

inline py::bytes to_bytes(Bytes data) {
  return {reinterpret_cast<const char*>(data.data()), data.size()};
}

inline Bytes from_bytes(const py::bytes& bytes) {
  const auto text = static_cast<std::string_view>(bytes);
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The key of a file; none without one. Throws InputError.
inline std::optional<Key> to_key(const std::optional<std::filesystem::path>& file) {
  return file ? std::optional<Key>(*file) : std::nullopt;
}

}  // namespace sprag::python
