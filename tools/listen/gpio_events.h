// Edges of GPIO lines as the Linux kernel reports them (version 2 of the character device), without
// the device itself: lost edges are known by their sequence numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/listen/line_parser.h"

namespace sprag {

/// "/dev/gpiochip0:17,27".
struct GpioRequest {
  std::string chip;
  std::vector<std::uint32_t> lines;  ///< offsets, the k-th is contact k
};

/// Throws UsageError, also if there are more lines than contacts, or a line twice.
GpioRequest parse_gpio(const std::string& text, int contacts);

/// One gpio_v2_line_event.
struct GpioEvent {
  std::uint64_t timestamp_ns = 0;  ///< CLOCK_MONOTONIC
  bool rising = false;
  std::uint32_t line = 0;
  std::uint32_t seqno = 0;  ///< of all lines of the request, from 1, wraps
};

class GpioEvents {
 public:
  /// `start`: the monotonic time that is t = 0 [ns].
  GpioEvents(std::vector<std::uint32_t> lines, std::int64_t start)
      : lines_(std::move(lines)), start_(start) {}

  struct Edge {
    ParsedLine line;         ///< time in ns
    std::uint32_t lost = 0;  ///< events that the kernel dropped before this one
  };

  /// Nullopt: the event is of another line.
  std::optional<Edge> take(const GpioEvent& event);

 private:
  std::vector<std::uint32_t> lines_;
  std::int64_t start_;
  std::uint32_t last_ = 0;  // sequence number
};

}  // namespace sprag
