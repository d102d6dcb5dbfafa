#include "tools/identify/mended_events.h"

#include <stdexcept>

#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/identification/repaired_events.h"

namespace sprag {
void write_mended(const std::filesystem::path& file, std::span<const ContactEvent> events,
                  const ContactClock& clock, const Identification& fit) {
  NotedEventsWriter writer(file);
  for (NotedEvent& noted : noted_events(events, fit)) {
    noted.event.t = clock_time(clock, noted.event.t);
    writer.write(noted.event, noted.note);
  }
  if (!writer.close()) throw std::runtime_error(writer.error());
}

}  // namespace sprag
