// A publisher of events and a listener for estimates, over LCM, in Python.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_live(pybind11::module_& module);

}  // namespace sprag::python
