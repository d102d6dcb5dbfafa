// Values: classes that pickle and compare equal. The list of a class's members is the only thing
// that it needs; numbers keep all their bits.
#pragma once

#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "python/src/arrays.h"
#include "sprag/sampled_input.h"
#include "sprag/version.h"

/// Lists all members of an aggregate in the order of their declaration, next to the namespace of
/// the class. A list of another length does not compile.
#define SPRAG_MEMBERS(Class, ...)                      \
  template <typename T>                                \
  requires std::same_as<std::remove_const_t<T>, Class> \
  auto members(T& object) {                            \
    auto& [__VA_ARGS__] = object;                      \
    return std::tie(__VA_ARGS__);                      \
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

/// Appends the members of values to a string of bytes. Objects with several owners are written
/// once.
class Packer {
 public:
  /// For comparison, 0 and -0 are written alike, and so are all nan.
  explicit Packer(bool for_comparison) : for_comparison_(for_comparison) {}

  template <typename T>
  void add(const T& value) {
    if constexpr (Plain<T>) {
      add_plain(value);
    } else if constexpr (std::same_as<T, std::string>) {
      add(value.size());
      bytes_ += value;
    } else if constexpr (EigenDense<T>) {
      add(value.rows());
      add(value.cols());
      for (Eigen::Index i = 0; i < value.size(); ++i) add(value.data()[i]);
    } else if constexpr (instance<std::vector, T>) {
      add(value.size());
      for (const typename T::value_type& of : value) add(of);
    } else if constexpr (is_array<T>) {
      for (const auto& of : value) add(of);
    } else if constexpr (instance<std::optional, T>) {
      add(value.has_value());
      if (value) add(*value);
    } else if constexpr (instance<std::pair, T>) {
      add(value.first);
      add(value.second);
    } else if constexpr (instance<std::shared_ptr, T>) {
      add_shared(value);
    } else if constexpr (std::same_as<T, SampledInput>) {
      if (value.is_streamed()) throw std::invalid_argument("a streamed input is no value");
      add(value.sample_times());
      add(value.sample_values());
      add(value.settings());
    } else {
      std::apply([this](const auto&... of) { (add(of), ...); }, members(value));
    }
  }

  std::string bytes() && { return std::move(bytes_); }

 private:
  template <typename T>
  void add_plain(T value) {
    if constexpr (std::is_floating_point_v<T>) {
      if (for_comparison_)
        value = value != value ? std::numeric_limits<T>::quiet_NaN() : value + T{0};
    }
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }

  // 0: none; k: the k-th object, which follows where it is new.
  template <typename T>
  void add_shared(const std::shared_ptr<T>& pointer) {
    if (!pointer) return add(std::size_t{0});
    std::size_t k = 0;
    while (k < shared_.size() && shared_[k] != pointer.get()) ++k;
    add(k + 1);
    if (k < shared_.size()) return;
    shared_.push_back(pointer.get());
    add(*pointer);
  }

  bool for_comparison_;
  std::string bytes_;
  std::vector<const void*> shared_;
};

/// Reads what Packer has written. Throws std::invalid_argument at the end of the bytes.
class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  T take() {
    if constexpr (Plain<T>) {
      T value;
      std::memcpy(&value, taken(sizeof value).data(), sizeof value);
      return value;
    } else if constexpr (std::same_as<T, std::string>) {
      return std::string(taken(take<std::size_t>()));
    } else if constexpr (EigenDense<T>) {
      return take_dense<T>();
    } else if constexpr (instance<std::vector, T>) {
      T values;
      for (auto n = take<std::size_t>(); n > 0; --n) {
        values.push_back(take<typename T::value_type>());
      }
      return values;
    } else if constexpr (is_array<T>) {
      T values;
      for (auto& of : values) of = take<typename T::value_type>();
      return values;
    } else if constexpr (instance<std::optional, T>) {
      return take<bool>() ? T(take<typename T::value_type>()) : T();
    } else if constexpr (instance<std::pair, T>) {
      T pair;
      pair.first = take<typename T::first_type>();
      pair.second = take<typename T::second_type>();
      return pair;
    } else if constexpr (instance<std::shared_ptr, T>) {
      return take_shared<typename T::element_type>();
    } else if constexpr (std::same_as<T, SampledInput>) {
      const auto t = take<std::vector<double>>(), values = take<std::vector<double>>();
      return SampledInput(t, values, take<SampledInput::Settings>());
    } else {
      T value{};
      std::apply([this](auto&... of) { ((of = take<std::remove_cvref_t<decltype(of)>>()), ...); },
                 members(value));
      return value;
    }
  }

 private:
  std::string_view taken(std::size_t n) {
    if (n > bytes_.size()) throw std::invalid_argument("the state of the value is too short");
    const std::string_view first = bytes_.substr(0, n);
    bytes_.remove_prefix(n);
    return first;
  }

  template <typename T>
  T take_dense() {
    const auto rows = take<Eigen::Index>(), columns = take<Eigen::Index>();
    const auto most = static_cast<Eigen::Index>(bytes_.size() / sizeof(typename T::Scalar));
    if (rows < 0 || columns < 0 || (columns > 0 && rows > most / columns)) {
      throw std::invalid_argument("the state of the value is too short");
    }
    T value(rows, columns);
    for (Eigen::Index i = 0; i < value.size(); ++i) value.data()[i] = take<typename T::Scalar>();
    return value;
  }

  template <typename T>
  std::shared_ptr<T> take_shared() {
    const auto k = take<std::size_t>();
    if (k == 0) return nullptr;
    if (k > shared_.size()) {
      auto object = std::make_shared<T>(take<std::remove_const_t<T>>());
      shared_.push_back(object);
      return object;
    }
    return std::const_pointer_cast<T>(std::static_pointer_cast<const T>(shared_[k - 1]));
  }

  std::string_view bytes_;
  std::vector<std::shared_ptr<const void>> shared_;
};

template <typename T>
std::string packed(const T& value, bool for_comparison) {
  Packer packer(for_comparison);
  packer.add(value);
  return std::move(packer).bytes();
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
    if constexpr (std::is_invocable_v<First, T&, py::handle>) {
      this->def_property_readonly(
          name, [first](const py::object& self) { return first(self.cast<T&>(), self); }, doc);
    } else if constexpr (Viewed<decltype(follow_path(std::declval<T&>(), first, rest...))>) {
      this->def_property_readonly(
          name,
          [=](const py::object& self) {
            return view(follow_path(self.cast<T&>(), first, rest...), self);
          },
          doc);
    } else {
      this->def_property_readonly(
          name, [=](T& of) -> decltype(auto) { return follow_path(of, first, rest...); },
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
            const std::string bytes = state[1].cast<py::bytes>();
            return Unpacker(bytes).take<T>();
          }))
      .def("__repr__", shown_by("one_line"))
      .def("_repr_html_", shown_by("as_html"));
  return of;
}

}  // namespace sprag::python
