// What `view` needs of the bus and of LCM logs.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

namespace py = pybind11;

void bind_bus(py::module_& module);

}  // namespace sprag::python
