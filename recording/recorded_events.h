// The events of a recording, an LCM log or an events CSV, as an observer that replays it hears
// them. For programs that need them all at once, without a replica and its ticks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command_line/program.h"
#include "lcmtypes/key.h"
#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/events_file.h"

namespace sprag {

struct RecordedEvents {
  std::vector<ContactEvent> events;   ///< times ascending, all since `begins` but in gaps
  std::vector<EventGap> gaps;         ///< in order and apart
  double begins = 0.0;                ///< 0 where every event since t = 0 is known [s]
  ContactSet closed = 0;              ///< there
  std::vector<std::string> problems;  ///< for people; each begins with the file's name
  bool whole = true;                  ///< false: the file is damaged; what is readable is used
  std::int64_t sessions = 0;          ///< of masters in a log; the events are those of the last
};

/// For a program that runs up to the last event of a CSV, or to `end` [s], infinity where the user
/// has not said it. Throws InputError for an implausible time that decides where the run ends.
/// `advice`: what else the user can do, after "correct or remove the row".
void refuse_implausible_end(const EventsFile& events, const std::string& file, double end,
                            const std::string& advice =
                                ", shift all times (import_events "
                                "--offset), or give --duration, up to "
                                "which events count");

/// What to do with events behind records of a log that were lost.
enum class AfterLoss { used, dropped };

/// Reads the events of a machine with `contacts` contacts, up to time `end` [s]. With a key only
/// messages that it has signed count. Throws InputError if the file cannot be opened.
RecordedEvents read_recorded_events(const std::filesystem::path& file, int contacts, double end,
                                    AfterLoss behind, const std::optional<Key>& key);

/// The same for a program: problems go to stderr and into its report.
RecordedEvents read_recorded_events(const std::filesystem::path& file, int contacts, double end,
                                    AfterLoss behind, const CommonOptions& common,
                                    nlohmann::ordered_json& report);

}  // namespace sprag
