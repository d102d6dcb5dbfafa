// The events of a recording, an LCM log or an events CSV, as an observer receives them in a replay.
// For programs that need all events at once, without a replica and its ticks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "lcmtypes/key.h"
#include "sprag/contact_event.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/events_file.h"
#include "sprag/scene.h"

namespace sprag {

struct RecordedEvents {
  /// Ascending, in the machine's time; complete since `begins`, except in gaps.
  std::vector<ContactEvent> events;
  std::vector<EventGap> gaps;         ///< ascending and disjoint
  double begins = 0.0;                ///< 0 if every event since t = 0 is known [s]
  ContactSet closed = 0;              ///< contacts closed at `begins`
  std::vector<std::string> problems;  ///< for the user; each begins with the file's name
  bool whole = true;                  ///< false: the file is damaged; the readable part is used
  std::int64_t sessions = 0;          ///< master sessions in a log; the events are of the last one
};

/// Reads an events CSV and converts its times from `clock` to the machine's time. Adds lines to
/// `problems` about events before t = 0 and skipped rows, which are left out, and about damage,
/// from which on nothing is used. Throws InputError as read_events() does, and if the end of a run
/// is undefined because the last event has an implausible time. `end` [s] is the end that the user
/// has specified, infinity if none: then a run ends at the last event.
EventsFile read_machine_events(InputFile file, int contacts, double end, const ContactClock& clock,
                               std::vector<std::string>& problems);

/// Treatment of the events after lost records of a log.
enum class AfterLoss { used, dropped };

/// Reads the events of a machine with `contacts` contacts, up to the machine's time `end` [s].
/// Times of the file are on `clock`. With a key only messages signed with it are used. Throws
/// InputError if the file cannot be opened.
RecordedEvents read_recorded_events(const std::filesystem::path& file, int contacts, double end,
                                    AfterLoss after_loss, const std::optional<Key>& key,
                                    const ContactClock& clock = {});

/// The same for a program: problems are printed to stderr and added to its report.
RecordedEvents read_recorded_events(const std::filesystem::path& file, const Scene& scene,
                                    double end, AfterLoss after_loss, const CommonOptions& common,
                                    nlohmann::ordered_json& report);

}  // namespace sprag
