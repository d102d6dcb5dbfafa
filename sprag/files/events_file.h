// Events CSV `t,contact,closed`: contact from 1, closed 1 or 0; a pulse is two rows of one contact
// with equal t, 1 then 0. 17 significant digits.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sprag/files/csv.h"
#include "sprag/files/csv_writer.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/event_gap.h"

namespace sprag {

class EventsWriter : public CsvWriter {
 public:
  /// Writes the header; a failure shows in good().
  explicit EventsWriter(OutputFile file);
  /// The same into a file that is created or emptied.
  explicit EventsWriter(const std::filesystem::path& file) : EventsWriter(OutputFile(file)) {}

  /// Appends the event's row, or a pulse's two rows. Failures are remembered.
  void write(const ContactEvent& event) noexcept;

 private:
  void write_row(double t, int contact, char closed) noexcept;
};

struct EventsFile {
  std::vector<ContactEvent> events;   ///< times ascending; equal times in the file's order
  std::vector<FileProblem> skipped;   ///< rows that contradict the rest, left out
  std::optional<FileProblem> damage;  ///< where reading stopped: nothing after it is used
  /// Where events may be missing, by what was skipped or damaged; +infinity: up to the end.
  std::vector<EventGap> gaps;
};

/// Reads the events of a machine with `contacts` contacts, all open at first. Damage: a line that
/// is garbled (also a time that is negative or not finite), a last line without an end, a wrong
/// header. Skipped: a time that goes backwards, an unknown contact, a flag other than 0 and 1, a
/// contact that closes while closed or opens while open. Empty lines are passed over. Throws
/// InputError if the file cannot be opened.
EventsFile read_events(const std::filesystem::path& file, int contacts);
EventsFile read_events(InputFile file, int contacts);

}  // namespace sprag
