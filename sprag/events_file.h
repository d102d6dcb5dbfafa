/// \file
/// \brief Reads events CSV files.
///
/// The header is `t,contact,closed`. Contacts are counted from 1 in the file and from 0 in C++.
/// `closed` is 1 or 0. A pulse is two rows of one contact with equal t, 1 then 0. Numbers have 17
/// significant digits. An optional fourth column `note` holds an EventNote.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"

namespace sprag {

/// \brief A row before or after a silence that looks like a wrong time stamp.
struct ImplausibleTime {
  double t;             ///< later end of the silence [s]
  FileProblem problem;  ///< line and text
};

/// \brief Note on an event in the fourth column of a file.
enum class EventNote {
  none,      ///< no note
  lost,      ///< inserted; no sensor reported it
  spurious,  ///< not an event of the machine; readers ignore the row
  suspect    ///< its time is doubtful
};

/// \brief The text of a note in a file.
/// \param note a note.
/// \return "", "lost", "spurious" or "suspect".
std::string_view name_of(EventNote note);

/// \brief Content of an events CSV.
struct EventsFile {
  std::vector<ContactEvent> events;   ///< times ascending; equal times in the file's order
  std::vector<FileProblem> skipped;   ///< rows that contradict the others; they are not in events
  std::optional<FileProblem> damage;  ///< where reading stopped; later rows are not in events
  /// \brief Intervals in which events may be missing because of skipped or damaged rows. An
  /// interval up to the end of the file ends at +infinity.
  std::vector<EventGap> gaps;
  /// \brief The first row after a silence of more than 200 times all the time before it (10 000
  /// times, among the first ten rows). Or the first row of a file of at least ten rows, if the time
  /// before it is more than 10 000 times the duration of all rows.
  std::optional<ImplausibleTime> implausible;
};

/// \brief Reads the events of a machine. All contacts are open at first.
///
/// Damage ends the reading: a garbled line (also a time that is negative or not finite), a last
/// line without an end, a wrong header. A row is skipped if its time goes backwards, or its contact
/// closes while closed or opens while open. Empty lines and rows with the note "spurious" are
/// ignored.
/// \param file path of the file.
/// \param contacts number of the machine's contacts.
/// \return the events and all problems.
/// \throws InputError if the file cannot be opened. Also, with "FILE:LINE:COLUMN: ", for a contact
/// that the machine does not have or a flag other than 0 and 1: the file belongs to another machine
/// or counts contacts in another way.
EventsFile read_events(const std::filesystem::path& file, int contacts);
/// \brief Converts the times of a file from the contact clock to the machine's time.
///
/// Leaves out events before the machine's t = 0. A contact that closes before t = 0 and opens later
/// closes at t = 0. A true clock changes nothing.
/// \param clock the contact clock.
/// \param file content of an events CSV.
/// \return number of events that were left out.
std::size_t to_machine_time(const ContactClock& clock, EventsFile& file);

}  // namespace sprag
