// Control characters and invalid UTF-8 become escapes; all other text stays unchanged.
#include "sprag/detail/text/printable.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/random.h"

namespace sprag {
namespace {

/// Valid UTF-8 without control bytes, by an independent implementation.
void expect_printable(const std::string& text, const std::string& of) {
  for (const char c : text) {
    EXPECT_FALSE(static_cast<unsigned char>(c) < 0x20 || c == '\x7f') << testing::PrintToString(of);
  }
  EXPECT_NO_THROW((void)nlohmann::json(text).dump()) << testing::PrintToString(of);
}

TEST(PrintableTest, EveryByteAlone) {
  for (int byte = 0; byte < 256; ++byte) {
    const std::string text(1, static_cast<char>(byte));
    const bool plain = byte >= 0x20 && byte < 0x7f;
    EXPECT_EQ(printable(text) == text, plain) << byte;
    expect_printable(printable(text), text);
  }
  using namespace std::string_literals;
  EXPECT_EQ(printable("a\n\r\t\x1b[31m\0\x7f\xff"s), R"(a\n\r\t\x1b[31m\x00\u007f\xff)");
}

TEST(PrintableTest, EveryCharacterOfUnicode) {
  const auto encoded = [](unsigned code) {
    const auto tail = [code](int shift) {
      return static_cast<char>(0x80U | ((code >> shift) & 0x3fU));
    };
    if (code < 0x80) return std::string{static_cast<char>(code)};
    if (code < 0x800) return std::string{static_cast<char>(0xc0U | code >> 6U), tail(0)};
    if (code < 0x10000) {
      return std::string{static_cast<char>(0xe0U | code >> 12U), tail(6), tail(0)};
    }
    return std::string{static_cast<char>(0xf0U | code >> 18U), tail(12), tail(6), tail(0)};
  };
  for (unsigned code = 0x20; code < 0x120000; ++code) {
    const std::string text = encoded(code);
    const bool controls = (code >= 0x7f && code < 0xa0) || code == 0x200e || code == 0x200f ||
                          (code >= 0x2028 && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
    const bool none = (code >= 0xd800 && code < 0xe000) || code > 0x10ffff || code == 0xfeff ||
                      (code & 0xfffeU) == 0xfffe;
    ASSERT_EQ(printable(text) == text, !controls && !none) << std::hex << code;
  }
  EXPECT_EQ(printable("\xc2\x9b[31m \xe2\x80\xae \xef\xbf\xbf"), R"(\u009b[31m \u202e \uffff)");
}

TEST(PrintableTest, TruncatedAndOverlongSequencesAreEscaped) {
  EXPECT_EQ(printable("\xc3"), R"(\xc3)");
  EXPECT_EQ(printable("\xe2\x82x"), R"(\xe2\x82x)");
  EXPECT_EQ(printable("\xc1\x8a"), R"(\xc1\x8a)") << "a line break in two bytes";
  EXPECT_EQ(printable("\xe0\x80\x8a"), R"(\xe0\x80\x8a)");
  EXPECT_EQ(printable("\xf0\x80\x80\x8a"), R"(\xf0\x80\x80\x8a)");
}

TEST(PrintableTest, IsIdempotentForAnyBytes) {
  Random random(7);
  for (int i = 0; i < 20000; ++i) {
    std::string text;
    for (int k = 0; k < 8; ++k) text += static_cast<char>(random.integer(0, 255));
    const std::string once = printable(text);
    expect_printable(once, text);
    ASSERT_EQ(printable(once), once);
  }
}

TEST(PrintableTest, LinesAndJsonAreUnchanged) {
  EXPECT_EQ(printable_lines("a\nb\x1b\n"), "a\nb\\x1b\n");
  const nlohmann::json object{{"name", "\x1b\x7f\xc2\x9b\xe2\x80\xae\n Ω"}};
  const std::string text = printable_lines(object.dump(2));
  EXPECT_EQ(nlohmann::json::parse(text), object);
  for (const char* control : {"\x1b", "\x7f", "\xc2\x9b", "\xe2\x80\xae"}) {
    EXPECT_EQ(text.find(control), std::string::npos);
  }
}

TEST(PrintableTest, StreamIsRestoredAfterFiltering) {
  std::ostringstream out;
  {
    const PrintableStream filtered(out);
    out << "a\x1b" << '\x07' << std::string("Ω\xff") << 1.5 << std::endl;
  }
  out << "\x1b";
  EXPECT_EQ(out.str(), "a\\x1b\\x07Ω\\xff1.5\n\x1b");
  EXPECT_TRUE(out.good());
}

}  // namespace
}  // namespace sprag
