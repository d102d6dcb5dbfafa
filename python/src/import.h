// Python binding of the import of time stamps and levels.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_import(pybind11::module_& module);

}  // namespace sprag::python
