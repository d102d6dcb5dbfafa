// Names and other text from files, on their way to a terminal or into a picture: a control
// character in them would be obeyed there.
#pragma once

#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>

namespace sprag {

/// \brief `text` as one line of valid UTF-8 without control characters.
/// Written as an escape: control characters, also those of Unicode and those that turn the
/// direction of writing, line and paragraph separators, noncharacters (`\n`, `\x1b`, `\u009b`), and
/// every byte that is not UTF-8 (`\xff`). All other text stays as it is.
std::string printable(std::string_view text);

/// The same for text of several lines: '\n' stays. JSON stays JSON of the same meaning.
std::string printable_lines(std::string_view text);

/// What is written to a stream passes through printable_lines(), as long as the object exists.
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
  std::streambuf* own_;  // of the stream, before and afterwards
};

}  // namespace sprag
