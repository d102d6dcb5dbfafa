// Python bindings of what is made of recordings: identification, diagnosis, smoothing, impacts,
// predictions and reduction.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_analyses(pybind11::module_& module);

}  // namespace sprag::python
