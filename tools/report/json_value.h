// Values of a JSON report that may be absent or of another type, as in a file of another version.
#pragma once

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace sprag::report {

using Json = nlohmann::ordered_json;

/// The value at a JSON pointer, "/confidence/bound"; null if there is none.
inline const Json* at(const Json& object, const std::string& pointer) {
  const Json::json_pointer path(pointer);
  return object.contains(path) ? &object.at(path) : nullptr;
}

/// The finite number there; nullopt for anything else.
inline std::optional<double> number_at(const Json& object, const std::string& pointer) {
  const Json* value = at(object, pointer);
  if (value == nullptr || !value->is_number()) return std::nullopt;
  const double number = value->get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

/// The whole number there, 0 or more, as a text; empty for anything else.
inline std::string count_at(const Json& object, const std::string& pointer) {
  const Json* value = at(object, pointer);
  return value != nullptr && value->is_number_unsigned() ? value->dump() : std::string();
}

/// The text there; empty for anything else.
inline std::string text_at(const Json& object, const std::string& pointer) {
  const Json* value = at(object, pointer);
  return value != nullptr && value->is_string() ? value->get<std::string>() : std::string();
}

/// Whether there is `true`.
inline bool is_true_at(const Json& object, const std::string& pointer) {
  const Json* value = at(object, pointer);
  return value != nullptr && value->is_boolean() && value->get<bool>();
}

/// The list there; an empty one for anything else.
inline Json list_at(const Json& object, const std::string& pointer) {
  const Json* value = at(object, pointer);
  return value != nullptr && value->is_array() ? *value : Json::array();
}

}  // namespace sprag::report
