// Python bindings of the runs with which tolerance() finds its limits.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_tolerances(pybind11::module_& module);

}  // namespace sprag::python
