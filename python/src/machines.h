// Python bindings of beams, models and scenes.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_machines(pybind11::module_& module);

}  // namespace sprag::python
