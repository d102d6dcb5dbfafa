// Results as numpy arrays: read-only views of C++ data, without copies, that keep their owner
// alive. Those of Eigen's vectors and matrices are made by pybind11.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag::python {

namespace py = pybind11;

using Numbers = py::array_t<double>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The same array, read-only.
py::array read_only(py::array array);

/// n entries.
Numbers view(const std::vector<double>& values, py::handle owner);
/// The same as boolean values.
py::array_t<bool> view(const std::vector<std::uint8_t>& flags, py::handle owner);
/// Of a vector without entries none.
std::optional<Numbers> view_or_none(const Eigen::VectorXd& values, py::handle owner);

/// Makes the dtype of ContactEvent, with the fields t, contact and kind. In Python contacts count
/// from 1.
py::dtype make_event_dtype();

/// n entries. The contacts in `events` must count from 1 already.
py::array view(const std::vector<ContactEvent>& events, py::handle owner);

/// The same of events with contacts from 0, which the array owns; in it contacts count from 1.
py::array owned(std::vector<ContactEvent> events);

/// Converts an array of events, or a sequence of triples, to events with contacts from 0.
/// Throws std::invalid_argument if an entry is no event of a machine with `contacts` contacts.
std::vector<ContactEvent> to_events(const py::object& events, std::size_t contacts);

/// Contacts of a set in ascending order, from 1.
py::tuple contacts_of(ContactSet set);

/// One event; `contact` from 1. Throws std::invalid_argument.
ContactEvent to_event(double t, int contact, int kind, std::size_t contacts);

}  // namespace sprag::python
