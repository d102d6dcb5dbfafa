#include "tools/listen/gpio_events.h"

#include <algorithm>
#include <limits>
#include <string_view>

#include "command_line/program.h"
#include "sprag/detail/files/csv.h"

namespace sprag {

GpioRequest parse_gpio(const std::string& text, int contacts) {
  const auto refuse = [&text](const std::string& why) {
    throw UsageError("--gpio " + text + ": " + why +
                     "; must be CHIP:LINE,... as /dev/gpiochip0:17,27");
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) refuse("has no chip");
  GpioRequest request{.chip = text.substr(0, colon), .lines = {}};
  std::vector<std::string_view> fields;
  split_fields(std::string_view(text).substr(colon + 1), fields);
  for (const std::string_view field : fields) {
    const auto line = parse_integer(field);
    if (!line || *line < 0 || *line > std::numeric_limits<std::uint32_t>::max())
      refuse("'" + std::string(field) + "' is no line");
    request.lines.push_back(static_cast<std::uint32_t>(*line));
    if (std::ranges::count(request.lines, request.lines.back()) > 1)
      refuse("line " + std::string(field) + " occurs twice");
  }
  if (request.lines.size() > static_cast<std::size_t>(contacts)) {
    refuse("has " + std::to_string(request.lines.size()) + " lines, and the scene " +
           std::to_string(contacts) + (contacts == 1 ? " contact" : " contacts"));
  }
  return request;
}

std::optional<GpioEvents::Edge> GpioEvents::take(const GpioEvent& event) {
  Edge edge;
  // Numbers count from 1 and wrap with the type.
  edge.lost = event.seqno - last_ - 1;
  last_ = event.seqno;
  const auto line = std::ranges::find(lines_, event.line);
  if (line == lines_.end()) return std::nullopt;
  edge.line.kind = ParsedLine::Kind::levels;
  const auto since = static_cast<std::int64_t>(event.timestamp_ns) - start_;
  edge.line.time = ClockTime{{since, 0}, ClockTime::Kind::number};
  edge.line.levels.push_back({static_cast<int>(line - lines_.begin()), event.rising ? 1.0 : 0.0});
  return edge;
}

}  // namespace sprag
