#include "tools/view/json_text.h"

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace sprag::view {
namespace {

template <class Number>
void append_shortest(std::string& text, Number number) {
  if (!std::isfinite(number)) {
    text += "null";
    return;
  }
  std::array<char, 40> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
  text.append(digits.data(), end);
}

}  // namespace

void JsonText::key(std::string_view name) {
  value(name);
  text_ += ':';
  fresh_ = true;
}

void JsonText::value(double number) {
  comma();
  append_shortest(text_, number);
}

void JsonText::value(std::int64_t number) {
  comma();
  text_ += std::to_string(number);
}

void JsonText::value(bool flag) {
  comma();
  text_ += flag ? "true" : "false";
}

void JsonText::value(std::string_view text) {
  comma();
  text_ += nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void JsonText::null() {
  comma();
  text_ += "null";
}

void JsonText::list(std::span<const double> numbers) {
  open('[');
  for (const double number : numbers) value(number);
  close(']');
}

void JsonText::drawn(std::span<const double> numbers) {
  open('[');
  for (const double number : numbers) drawn(number);
  close(']');
}

void JsonText::drawn(double number) {
  comma();
  append_shortest(text_, static_cast<float>(number));
}

}  // namespace sprag::view
