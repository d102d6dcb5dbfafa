// Python bindings of the publisher of events and the listener for estimates, over LCM.
#pragma once

#include <pybind11/pybind11.h>

#include <filesystem>
#include <optional>

#include "lcmtypes/key.h"

namespace sprag::python {

/// The key of a file; none without one. Throws InputError.
std::optional<Key> to_key(const std::optional<std::filesystem::path>& file);

void bind_live(pybind11::module_& module);

}  // namespace sprag::python
