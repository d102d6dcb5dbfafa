// Python bindings of the publisher of events and the listener for estimates, over LCM.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_live(pybind11::module_& module);

}  // namespace sprag::python
