// Writes JSON text member by member. Numbers that are not finite become null.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace sprag::view {

class JsonText {
 public:
  void open(char bracket) {
    comma();
    text_ += bracket;
    fresh_ = true;
  }
  void close(char bracket) {
    text_ += bracket;
    fresh_ = false;
  }
  /// The name of a member; its value follows.
  void key(std::string_view name);

  void value(double number);  ///< shortest text that gives the same double
  void value(std::int64_t number);
  void value(bool flag);
  void value(std::string_view text);  ///< invalid UTF-8 is replaced
  void value(const char* text) { value(std::string_view(text)); }
  void null();
  void value(const std::optional<double>& number) { number ? value(*number) : null(); }
  /// A list of numbers, in the shortest text that gives the same double (list) or the same float
  /// (drawn, for pictures).
  void list(std::span<const double> numbers);
  void drawn(std::span<const double> numbers);
  /// One number with the digits of a float.
  void drawn(double number);

  template <class Value>
  void member(std::string_view name, const Value& of) {
    key(name);
    value(of);
  }

  std::string take() && { return std::move(text_); }

 private:
  void comma() {
    if (!fresh_) text_ += ',';
    fresh_ = false;
  }

  std::string text_;
  bool fresh_ = true;
};

}  // namespace sprag::view
