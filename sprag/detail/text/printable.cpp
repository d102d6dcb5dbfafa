#include "sprag/detail/text/printable.h"

#include <array>
#include <cstdio>
#include <ostream>
#include <streambuf>

namespace sprag {
namespace {

struct Character {
  char32_t code = 0;
  std::size_t size = 0;  // in bytes; 0: not valid UTF-8
};

// The first character of `text`. RFC 3629: no overlong form, no surrogate.
Character first_character(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t size = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < size) return {};
  char32_t code = lead & (0x7fU >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0U) != 0x80U) return {};
    code = code << 6U | (byte(i) & 0x3fU);
  }
  constexpr std::array<char32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  if (code < least.at(size) || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return {};
  return {code, size};
}

// A character that a terminal interprets or that a reader cannot see.
bool is_control(char32_t code) {
  const auto in = [code](char32_t first, char32_t last) { return code >= first && code <= last; };
  return code < 0x20 || in(0x7f, 0x9f) || in(0x200e, 0x200f) || in(0x2028, 0x202e) ||
         in(0x2066, 0x2069) || code == 0xfeff || (code & 0xfffeU) == 0xfffe;
}

void append_escape(std::string& to, const char* format, unsigned number) {
  std::array<char, 16> escape{};
  std::snprintf(escape.data(), escape.size(), format, number);
  to += escape.data();
}

// Writes a control character as an escape of C, C++ and Python. In JSON the library has escaped all
// characters below 0x7f before, and \u is valid for the others.
void append_control(std::string& to, char32_t code) {
  if (code == '\n') {
    to += "\\n";
  } else if (code == '\t') {
    to += "\\t";
  } else if (code == '\r') {
    to += "\\r";
  } else if (code < 0x7f) {
    append_escape(to, "\\x%02x", static_cast<unsigned>(code));
  } else if (code <= 0xffff) {
    append_escape(to, "\\u%04x", static_cast<unsigned>(code));
  } else {
    append_escape(to, "\\U%08x", static_cast<unsigned>(code));
  }
}

std::string escaped(std::string_view text, bool keep_lines) {
  std::string result;
  result.reserve(text.size());
  while (!text.empty()) {
    const auto [code, size] = first_character(text);
    if (size == 0) {
      append_escape(result, "\\x%02x", static_cast<unsigned char>(text.front()));
      text.remove_prefix(1);
      continue;
    }
    if (is_control(code) && !(keep_lines && code == '\n')) {
      append_control(result, code);
    } else {
      result += text.substr(0, size);
    }
    text.remove_prefix(size);
  }
  return result;
}

}  // namespace

std::string printable(std::string_view text) { return escaped(text, false); }

std::string printable_lines(std::string_view text) { return escaped(text, true); }

// Stateless between calls, so it is as thread-safe as the stream buffer that it writes to.
class PrintableStream::Filter : public std::streambuf {
 public:
  explicit Filter(std::streambuf* to) : to_(to) {}

 protected:
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    const std::string clean =
        printable_lines(std::string_view(text, static_cast<std::size_t>(size)));
    const auto clean_size = static_cast<std::streamsize>(clean.size());
    return to_->sputn(clean.data(), clean_size) == clean_size ? size : 0;
  }
  int_type overflow(int_type character) override {
    if (traits_type::eq_int_type(character, traits_type::eof())) return traits_type::not_eof(0);
    const char text = traits_type::to_char_type(character);
    return xsputn(&text, 1) == 1 ? character : traits_type::eof();
  }
  int sync() override { return to_->pubsync(); }

 private:
  std::streambuf* to_;
};

PrintableStream::PrintableStream(std::ostream& stream)
    : stream_(stream), filter_(std::make_unique<Filter>(stream.rdbuf())), own_(stream.rdbuf()) {
  stream_.rdbuf(filter_.get());
}

PrintableStream::~PrintableStream() { stream_.rdbuf(own_); }

}  // namespace sprag
