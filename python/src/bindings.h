// The parts of the module sprag._core: each adds its classes and functions.
#pragma once

#include <pybind11/pybind11.h>

namespace sprag::python {

namespace py = pybind11;
using namespace py::literals;

void bind_machines(py::module_& module);
void bind_runs(py::module_& module);
void bind_analyses(py::module_& module);
void bind_import(py::module_& module);
void bind_studies(py::module_& module);
void bind_live(py::module_& module);
void bind_bus(py::module_& module);
void bind_recordings(py::module_& module);

}  // namespace sprag::python
