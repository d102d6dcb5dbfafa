// Python bindings of simulation, observer and energies.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

void bind_runs(pybind11::module_& module);

}  // namespace sprag::python
