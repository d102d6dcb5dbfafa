#include "python/src/arrays.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace sprag::python {
namespace {

static_assert(sizeof(ContactEvent::contact) == sizeof(std::int32_t));

constexpr py::ssize_t item_size = sizeof(double);

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

Numbers matrix_view(const double* data, Eigen::Index rows, Eigen::Index columns,
                    py::ssize_t row_stride, py::ssize_t column_stride, py::handle owner) {
  return read_only(py::array(py::dtype::of<double>(), {rows, columns},
                             {row_stride * item_size, column_stride * item_size}, data, owner));
}

Numbers vector_view(const double* data, py::ssize_t size, py::handle owner) {
  return read_only(py::array(py::dtype::of<double>(), {size}, {item_size}, data, owner));
}

}  // namespace

py::array read_only(py::array array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

Numbers view(const Eigen::VectorXd& values, py::handle owner) {
  return vector_view(values.data(), values.size(), owner);
}

Numbers view(const std::vector<double>& values, py::handle owner) {
  return vector_view(values.data(), std::ssize(values), owner);
}

Numbers view(const Rows& rows, py::handle owner) {
  return matrix_view(rows.data(), rows.rows(), rows.cols(), rows.cols(), 1, owner);
}

Numbers view(const Eigen::MatrixXd& matrix, py::handle owner) {
  return matrix_view(matrix.data(), matrix.rows(), matrix.cols(), 1, matrix.rows(), owner);
}

py::array_t<bool> view(const std::vector<std::uint8_t>& flags, py::handle owner) {
  return read_only(py::array(py::dtype::of<bool>(), {std::ssize(flags)}, {1}, flags.data(), owner));
}

std::optional<Numbers> view_or_none(const Eigen::VectorXd& values, py::handle owner) {
  return values.size() > 0 ? std::optional(view(values, owner)) : std::nullopt;
}

py::dtype event_dtype() {
  py::list names, formats, offsets;
  const auto field = [&](const char* name, const py::dtype& type, std::size_t offset) {
    names.append(name);
    formats.append(type);
    offsets.append(offset);
  };
  field("t", py::dtype::of<double>(), offsetof(ContactEvent, t));
  field("contact", py::dtype::of<std::int32_t>(), offsetof(ContactEvent, contact));
  field("kind", py::dtype::of<std::int8_t>(), offsetof(ContactEvent, kind));
  return {names, formats, offsets, sizeof(ContactEvent)};
}

py::array view(const std::vector<ContactEvent>& events, py::handle owner) {
  return read_only(py::array(event_dtype(), {static_cast<py::ssize_t>(events.size())},
                             {static_cast<py::ssize_t>(sizeof(ContactEvent))}, events.data(),
                             owner));
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
  const py::array array = py::module_::import("numpy").attr("array")(
      with_fields(events), event_dtype(), py::arg("order") = "C", py::arg("copy") = false);
  if (array.ndim() != 1) throw std::invalid_argument("events must have one dimension");
  std::vector<ContactEvent> taken;
  taken.reserve(static_cast<std::size_t>(array.size()));
  const auto* data = static_cast<const char*>(array.data());
  for (py::ssize_t i = 0; i < array.size(); ++i) {
    // An invalid kind must not be read as an enumerator.
    const char* entry = data + i * array.itemsize();
    const auto field = [entry]<typename T>(std::size_t offset, T value) {
      std::memcpy(&value, entry + offset, sizeof(T));
      return value;
    };
    try {
      taken.push_back(to_event(field(offsetof(ContactEvent, t), 0.0),
                               field(offsetof(ContactEvent, contact), std::int32_t{0}),
                               field(offsetof(ContactEvent, kind), std::int8_t{0}), contacts));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("events[" + std::to_string(i) + "]: " + error.what());
    }
  }
  return taken;
}

}  // namespace sprag::python
