// JSON text as it is sent, member by member. What is not finite becomes null.
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

  void value(double number);  ///< as many digits as give the same double again
  void value(std::int64_t number);
  void value(bool flag);
  void value(std::string_view text);  ///< what is no UTF-8 is replaced
  void value(const char* text) { value(std::string_view(text)); }
  void null();
  void value(const std::optional<double>& number) { number ? value(*number) : null(); }
  /// A list of numbers, with as many digits as give the same double, or the same float, again.
  void list(std::span<const double> numbers);
  void drawn(std::span<const double> numbers);
  /// One number of such a list, of a picture.
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
