// Values: classes that pickle and compare equal. The list of a class's members is the only thing
// that it needs; numbers keep all their bits.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "python/src/arrays.h"
#include "sprag/sampled_input.h"
#include "sprag/version.h"

/// Lists all members of an aggregate in the order of their declaration, next to the namespace of
/// the class. A list of another length does not compile.
#define SPRAG_MEMBERS(Class, ...)      \
  inline auto members(Class& object) { \
    auto& [__VA_ARGS__] = object;      \
    return std::tie(__VA_ARGS__);      \
  }

namespace sprag::python {

namespace py = pybind11;

template <typename T>
concept EigenDense = std::derived_from<T, Eigen::PlainObjectBase<T>>;
template <typename T>
concept Plain = std::is_arithmetic_v<T> || std::is_enum_v<T>;

/// Whether a type is an instance of a template: instance<std::vector, T>.
template <template <typename...> typename Template, typename T>
constexpr bool instance = false;
template <template <typename...> typename Template, typename... Arguments>
constexpr bool instance<Template, Template<Arguments...>> = true;
template <typename T>
constexpr bool is_array = false;
template <typename T, std::size_t n>
constexpr bool is_array<std::array<T, n>> = true;

/// The bytes of values, which it writes, or reads into them. Objects with several owners are there
/// once. Reading throws std::invalid_argument at the end of the bytes.
class Archive {
 public:
  /// Writes. For comparison, 0 and -0 are written alike, and so are all nan.
  explicit Archive(bool for_comparison) : for_comparison_(for_comparison) {}
  explicit Archive(std::string bytes) : reads_(true), bytes_(std::move(bytes)) {}

  /// Changes the value only in reading.
  template <typename T>
  void pass(T& value) {
    if constexpr (Plain<T>) {
      pass_plain(value);
    } else if constexpr (std::same_as<T, std::string>) {
      pass_size(value);
      pass_bytes(value.data(), value.size());
    } else if constexpr (EigenDense<T>) {
      Eigen::Index rows = value.rows(), columns = value.cols();
      pass(rows);
      pass(columns);
      if (reads_) {
        const auto most = static_cast<Eigen::Index>(left());
        require(rows >= 0 && columns >= 0 && (columns == 0 || rows <= most / columns));
        value.resize(rows, columns);
      }
      for (Eigen::Index i = 0; i < value.size(); ++i) pass(value.data()[i]);
    } else if constexpr (instance<std::vector, T>) {
      pass_size(value);
      for (auto&& of : value) {
        typename T::value_type entry = of;  // of std::vector<bool> `of` is no reference
        pass(entry);
        if (reads_) of = std::move(entry);
      }
    } else if constexpr (is_array<T>) {
      for (auto& of : value) pass(of);
    } else if constexpr (instance<std::optional, T>) {
      bool given = value.has_value();
      pass(given);
      if (reads_ && given) value.emplace();
      if (given) pass(*value);
    } else if constexpr (instance<std::pair, T>) {
      pass(value.first);
      pass(value.second);
    } else if constexpr (instance<std::shared_ptr, T>) {
      pass_shared(value);
    } else {
      std::apply([this](auto&... of) { (pass(of), ...); }, members(value));
    }
  }

  std::string bytes() && { return std::move(bytes_); }

 private:
  std::size_t left() const { return bytes_.size() - at_; }

  static void require(bool holds) {
    if (!holds) throw std::invalid_argument("the state of the value is too short");
  }

  void pass_bytes(void* data, std::size_t size) {
    if (!reads_) {
      bytes_.append(static_cast<const char*>(data), size);
      return;
    }
    require(size <= left());
    std::copy_n(bytes_.data() + at_, size, static_cast<char*>(data));
    at_ += size;
  }

  template <typename T>
  void pass_plain(T& value) {
    T same = value;
    if constexpr (std::is_floating_point_v<T>) {
      if (for_comparison_)
        same = std::isnan(value) ? std::numeric_limits<T>::quiet_NaN() : value + T{0};
    }
    pass_bytes(reads_ ? &value : &same, sizeof value);
  }

  template <typename Container>
  void pass_size(Container& container) {
    std::size_t size = container.size();
    pass(size);
    if (!reads_) return;
    require(size <= left());
    container.resize(size);
  }

  // 0: none; k: the k-th object, which follows where it is new.
  template <typename T>
  void pass_shared(std::shared_ptr<const T>& pointer) {
    const auto known = std::find(shared_.begin(), shared_.end(), pointer);
    auto k = pointer ? static_cast<std::size_t>(known - shared_.begin()) + 1 : 0;
    pass(k);
    if (k > shared_.size()) {
      pass_object(pointer);
      shared_.push_back(pointer);
    } else if (k > 0) {
      pointer = std::static_pointer_cast<const T>(shared_[k - 1]);
    }
  }

  template <typename T>
  void pass_object(std::shared_ptr<const T>& pointer) {
    auto object = reads_ ? std::make_shared<T>() : std::const_pointer_cast<T>(pointer);
    pass(*object);
    pointer = object;
  }

  void pass_object(SampledInputPointer& input) {
    if (!reads_ && input->is_streamed())
      throw std::invalid_argument("a streamed input is no value");
    auto t = reads_ ? std::vector<double>() : input->sample_times();
    auto values = reads_ ? std::vector<double>() : input->sample_values();
    auto settings = reads_ ? SampledInput::Settings() : input->settings();
    pass(t);
    pass(values);
    pass(settings);
    if (reads_) input = std::make_shared<const SampledInput>(t, values, settings);
  }

  bool for_comparison_ = false, reads_ = false;
  std::string bytes_;
  std::size_t at_ = 0;  // of the next byte to read
  std::vector<std::shared_ptr<const void>> shared_;
};

template <typename T>
std::string packed(const T& value, bool for_comparison) {
  Archive archive(for_comparison);
  archive.pass(const_cast<T&>(value));
  return std::move(archive).bytes();
}

/// What the members and functions of a path lead to: `&Scene::prior, &Prior::drift`.
template <typename T, typename First, typename... Rest>
decltype(auto) follow_path(T& of, const First& first, const Rest&... rest) {
  if constexpr (sizeof...(Rest) == 0) {
    return std::invoke(first, of);
  } else {
    return follow_path(std::invoke(first, of), rest...);
  }
}

template <typename T>
concept Viewed = std::is_lvalue_reference_v<T> && requires(T of, py::handle owner) {
  view(of, owner);
};

/// A class whose read-only attributes are added by get().
template <typename T, typename... Options>
struct ValueClass : py::class_<T, Options...> {
  using Base = py::class_<T, Options...>;
  using Base::Base;

  /// An attribute: what a path leads to, or what a function returns of the object or of the object
  /// and its handle. Vectors, matrices and events are read-only views.
  template <typename First, typename... Rest>
  ValueClass& get(const char* name, const char* doc, const First& first, const Rest&... rest) {
    using Self = std::conditional_t<std::is_invocable_v<First, const T&>, const T, T>;
    if constexpr (std::is_invocable_v<First, T&, py::handle>) {
      this->def_property_readonly(
          name, [first](const py::object& self) { return first(self.cast<T&>(), self); }, doc);
    } else if constexpr (Viewed<decltype(follow_path(std::declval<Self&>(), first, rest...))>) {
      this->def_property_readonly(
          name,
          [=](const py::object& self) {
            return view(follow_path(self.cast<Self&>(), first, rest...), self);
          },
          doc);
    } else {
      this->def_property_readonly(
          name, [=](Self& of) -> decltype(auto) { return follow_path(of, first, rest...); },
          py::return_value_policy::reference_internal, doc);
    }
    return *this;
  }

  template <typename... Arguments>
  ValueClass& def(Arguments&&... arguments) {
    Base::def(std::forward<Arguments>(arguments)...);
    return *this;
  }
};

/// A class with ==, hash(), pickle, a repr of one line and _repr_html_. Pickles are of one version
/// of Sprag only.
template <typename T, typename... Options>
ValueClass<T, Options...> value_class(py::handle module, const char* name, const char* doc) {
  ValueClass<T, Options...> of(module, name, doc);
  const auto shown_by = [](const char* function) {
    return [function](const py::object& self) {
      return py::module_::import("sprag._values").attr(function)(self);
    };
  };
  of.def(
        "__eq__",
        [](const T& a, const py::object& b) -> py::object {
          if (!py::isinstance<T>(b)) return py::reinterpret_borrow<py::object>(Py_NotImplemented);
          return py::bool_(packed(a, true) == packed(b.cast<const T&>(), true));
        },
        py::arg("other"))
      .def("__hash__", [](const T& value) { return py::hash(py::bytes(packed(value, true))); })
      .def(py::pickle(
          [](const T& value) {
            return py::make_tuple(SPRAG_VERSION, py::bytes(packed(value, false)));
          },
          [](const py::tuple& state) {
            if (state.size() != 2 || !py::str(SPRAG_VERSION).equal(py::object(state[0]))) {
              throw std::invalid_argument("pickled by another version of Sprag");
            }
            T value{};
            Archive(state[1].cast<std::string>()).pass(value);
            return value;
          }))
      .def("__repr__", shown_by("one_line"))
      .def("_repr_html_", shown_by("as_html"));
  return of;
}

}  // namespace sprag::python
