// Makes names and other text from files safe to print: a terminal would interpret control
// characters in them.
#pragma once

#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>

namespace sprag {

/// \brief `text` as one line of valid UTF-8 without control characters.
/// Replaced by escapes such as `\n`, `\x1b`, `\u009b`: control characters, including those of
/// Unicode and those that change the writing direction; line and paragraph separators;
/// noncharacters; and every byte that is not valid UTF-8 (`\xff`). All other text is unchanged.
std::string printable(std::string_view text);

/// The same for text of several lines: '\n' is kept. JSON keeps its meaning.
std::string printable_lines(std::string_view text);

/// While it exists, all output to a stream passes through printable_lines().
class PrintableStream {
 public:
  explicit PrintableStream(std::ostream& stream);
  PrintableStream(const PrintableStream&) = delete;
  PrintableStream& operator=(const PrintableStream&) = delete;
  ~PrintableStream();

 private:
  class Filter;
  std::ostream& stream_;
  std::unique_ptr<Filter> filter_;
  std::streambuf* own_;  // the stream's original buffer
};

}  // namespace sprag
