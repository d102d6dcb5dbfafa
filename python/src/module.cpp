// The module sprag._core. The package `sprag` re-exports its names.
#include <pybind11/pybind11.h>

#include <exception>

#include "lcmtypes/bus.h"
#include "lcmtypes/lcm_url.h"
#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/error.h"
#include "sprag/model.h"
#include "sprag/scene_file.h"

namespace sprag::python {
namespace {

// Exception classes defined in Python (sprag/_errors.py), created once and never freed.
struct ErrorClasses {
  py::object base, scene, model, simulation, bus, input;
};

const ErrorClasses* error_classes = nullptr;

py::object number_or_none(int number) {
  return number > 0 ? py::object(py::int_(number)) : py::object(py::none());
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): the type is pybind11's
void translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const SceneError& error) {
    const py::object raised =
        error_classes->scene(error.what(), error.file, number_or_none(error.line),
                             number_or_none(error.column), error.message);
    PyErr_SetObject(error_classes->scene.ptr(), raised.ptr());
  } catch (const ModelError& error) {
    PyErr_SetString(error_classes->model.ptr(), error.what());
  } catch (const SimulationError& error) {
    PyErr_SetString(error_classes->simulation.ptr(), error.what());
  } catch (const BusError& error) {
    PyErr_SetString(error_classes->bus.ptr(), error.what());
  } catch (const InputError& error) {
    PyErr_SetString(error_classes->input.ptr(), error.what());
  } catch (const UrlError& error) {
    PyErr_SetString(PyExc_ValueError, error.what());
  } catch (const Error& error) {
    PyErr_SetString(error_classes->base.ptr(), error.what());
  }
}

}  // namespace
}  // namespace sprag::python

PYBIND11_MODULE(_core, module) {
  using namespace sprag::python;
  module.doc() = "Sprag's C++ library; import sprag instead.";
  const py::module_ errors = py::module_::import("sprag._errors");
  error_classes = new ErrorClasses{errors.attr("Error"),      errors.attr("SceneError"),
                                   errors.attr("ModelError"), errors.attr("SimulationError"),
                                   errors.attr("BusError"),   errors.attr("InputError")};
  py::register_local_exception_translator(&translate);
  module.attr("event_dtype") = make_event_dtype();
  bind_machines(module);
  bind_runs(module);
  bind_analyses(module);
  bind_import(module);
  bind_studies(module);
  bind_live(module);
  bind_bus(module);
  bind_recordings(module);
}
