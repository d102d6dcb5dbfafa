// Writers of events CSV files (sprag/events_file.h).
#pragma once

#include <filesystem>

#include "sprag/contact_event.h"
#include "sprag/detail/files/csv_writer.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/events_file.h"

namespace sprag {

/// Writes an events CSV. The first failure is kept: good() is false and error() describes it.
class EventsWriter : public CsvWriter {
 public:
  /// Writes the header. A failure is reported by good().
  explicit EventsWriter(OutputFile file);
  /// Creates or empties a file and writes the header.
  explicit EventsWriter(const std::filesystem::path& file) : EventsWriter(OutputFile(file)) {}

  /// Appends the row of an event, or the two rows of a pulse. A failure is reported by good().
  void write(const ContactEvent& event) noexcept;

 private:
  void write_row(double t, int contact, std::string_view closed) noexcept;
};

/// Writes an events CSV with the column `note`.
class NotedEventsWriter : public CsvWriter {
 public:
  /// Creates or empties a file and writes the header. A failure is reported by good().
  explicit NotedEventsWriter(const std::filesystem::path& file);
  /// Appends the row of an event, or the two rows of a pulse. A failure is reported by good().
  void write(const ContactEvent& event, EventNote note) noexcept;
};

/// The same as in sprag/events_file.h for an open file.
EventsFile read_events(InputFile file, int contacts);

}  // namespace sprag
