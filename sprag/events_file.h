// Events CSV `t,contact,closed`: contact from 1, closed 1 or 0; a pulse is two rows of one contact
// with equal t, 1 then 0. 17 significant digits. A fourth column `note`, where there is one, says
// of an event what EventNote does.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/csv_writer.h"
#include "sprag/detail/mechanics/event_gap.h"

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

/// A row before or after a silence that looks like a wrong time stamp.
struct ImplausibleTime {
  double t;  ///< of the later end of the silence [s]
  FileProblem problem;
};

/// "lost": inserted, no sensor reported it; "spurious": left out by readers; "suspect": its time is
/// doubtful.
enum class EventNote { none, lost, spurious, suspect };

/// Writes events with the column `note`.
class NotedEventsWriter : public CsvWriter {
 public:
  explicit NotedEventsWriter(const std::filesystem::path& file);
  void write(const ContactEvent& event, EventNote note) noexcept;
};

struct EventsFile {
  std::vector<ContactEvent> events;   ///< times ascending; equal times in the file's order
  std::vector<FileProblem> skipped;   ///< rows that contradict the rest, left out
  std::optional<FileProblem> damage;  ///< where reading stopped: nothing after it is used
  /// Where events may be missing, by what was skipped or damaged; +infinity: up to the end.
  std::vector<EventGap> gaps;
  /// The first row that follows a silence of more than 200 times all the time before it (10 000
  /// times, before the tenth row); or the first row of all, if the time before it is more than
  /// 10 000 times that of all rows, ten at least.
  std::optional<ImplausibleTime> implausible;
};

/// Reads the events of a machine with `contacts` contacts, all open at first. Damage: a line that
/// is garbled (also a time that is negative or not finite), a last line without an end, a wrong
/// header. Skipped: a time that goes backwards, a contact that closes while closed or opens while
/// open. Empty lines and rows whose note is "spurious" are passed over. Throws InputError if the
/// file cannot be opened, and, with "FILE:LINE:COLUMN: ", for a contact that the machine does not
/// have or a flag other than 0 and 1: such a file belongs to another machine, or counts otherwise.
EventsFile read_events(const std::filesystem::path& file, int contacts);
EventsFile read_events(InputFile file, int contacts);

}  // namespace sprag
