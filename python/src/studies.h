// Python bindings of studies.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_studies(pybind11::module_& module);

}  // namespace sprag::python
