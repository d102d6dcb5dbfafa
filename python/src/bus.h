// What `view` needs of the bus and of recordings.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <span>
#include <string_view>

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

void bind_bus(py::module_& module);
void bind_recordings(py::module_& module);

}  // namespace sprag::python
