#include "python/src/arrays.h"

#include <pybind11/eigen.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace sprag::python {
namespace {

// Numpy would assign a plain number to all three fields, and fields of other names by their order;
// both are rejected here. Other sequences become a list of tuples, which numpy converts by entry.
py::object with_fields(const py::object& events) {
  const char* wrong =
      "events must be an array with fields t, contact and kind, or triples of them; pulses() makes "
      "such an array of times";
  if (py::isinstance<py::array>(events)) {
    const py::object names = events.attr("dtype").attr("names");
    if (!names.equal(py::make_tuple("t", "contact", "kind"))) throw std::invalid_argument(wrong);
    return events;
  }
  py::list triples;
  for (const py::handle event : events) {
    if (!py::isinstance<py::sequence>(event) || py::len(event) != 3) {
      throw std::invalid_argument(wrong);
    }
    triples.append(py::tuple(py::reinterpret_borrow<py::object>(event)));
  }
  return triples;
}

}  // namespace

py::array read_only(py::array array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

Numbers view(const std::vector<double>& values, py::handle owner) {
  return read_only(Numbers(std::ssize(values), values.data(), owner));
}

py::array_t<bool> view(const std::vector<std::uint8_t>& flags, py::handle owner) {
  return read_only(py::array(py::dtype::of<bool>(), {std::ssize(flags)}, {1}, flags.data(), owner));
}

std::optional<Numbers> view_or_none(const Eigen::VectorXd& values, py::handle owner) {
  if (values.size() == 0) return std::nullopt;
  return Numbers(py::cast(values, py::return_value_policy::reference_internal, owner));
}

py::dtype make_event_dtype() {
  PYBIND11_NUMPY_DTYPE(ContactEvent, t, contact, kind);
  return py::dtype::of<ContactEvent>();
}

py::array view(const std::vector<ContactEvent>& events, py::handle owner) {
  return read_only(py::array_t<ContactEvent>(std::ssize(events), events.data(), owner));
}

py::array owned(std::vector<ContactEvent> events) {
  for (ContactEvent& event : events) ++event.contact;
  auto data = std::make_unique<std::vector<ContactEvent>>(std::move(events));
  const py::capsule owner(data.get(),
                          [](void* of) { delete static_cast<std::vector<ContactEvent>*>(of); });
  return view(*data.release(), owner);
}

py::tuple contacts_of(ContactSet set) {
  py::list contacts;
  for_each(set, [&](int i) { contacts.append(i + 1); });
  return py::tuple(contacts);
}

ContactEvent to_event(double t, int contact, int kind, std::size_t contacts) {
  if (!(t >= 0.0) || !std::isfinite(t)) {
    throw std::invalid_argument("t is " + std::to_string(t) + "; must be a number >= 0");
  }
  if (contact < 1 || static_cast<std::size_t>(contact) > contacts) {
    throw std::invalid_argument("contact is " + std::to_string(contact) + "; must be from 1 to " +
                                std::to_string(contacts));
  }
  if (kind < 1 || kind > 3) {
    throw std::invalid_argument("kind is " + std::to_string(kind) +
                                "; must be CLOSES, OPENS or PULSE");
  }
  return {t, contact - 1, static_cast<ContactEventKind>(kind)};
}

std::vector<ContactEvent> to_events(const py::object& events, std::size_t contacts) {
  const py::array_t<ContactEvent, py::array::c_style | py::array::forcecast> array(
      with_fields(events));
  if (array.ndim() != 1) throw std::invalid_argument("events must have one dimension");
  std::vector<ContactEvent> taken;
  taken.reserve(static_cast<std::size_t>(array.size()));
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    const auto [t, contact, kind] = array.at(i);
    try {
      taken.push_back(to_event(t, contact, static_cast<int>(kind), contacts));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("events[" + std::to_string(i) + "]: " + error.what());
    }
  }
  return taken;
}

}  // namespace sprag::python
