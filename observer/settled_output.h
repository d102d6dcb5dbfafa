// What becomes of settled estimates, live and in a replay: rows of a states CSV, and what they say
// of their own error, told as it happens and summed up at the end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "lcmtypes/state_codec.h"
#include "observer/confidence_record.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/model.h"
#include "sprag/states_file.h"

namespace sprag {

class SettledOutput {
 public:
  /// `states` may be empty: no file then. `empty` has room for all that an estimate holds,
  /// `initial` is B(0). Throws std::runtime_error where the file cannot be written.
  SettledOutput(const std::filesystem::path& states, const EstimateSample& empty, double initial,
                std::vector<Output> outputs);

  /// Without a file only the last estimate has to be known in full.
  bool writes_states() const { return states_.has_value(); }

  /// Tick by tick, in order: in full, or what has happened, and now and then in full as well.
  void take(const EstimateSample& settled);
  void note(const EstimateSample& settled);
  void conclude(const EstimateSample& settled);
  /// So many more ticks, the last one at t [s], of which there is nothing new to note.
  void pass(std::int64_t ticks, double t);

  /// What was taken is in the file.
  void flush();

  /// How often the filter did not fit the events.
  std::int64_t inconsistencies() const { return record_.inconsistencies(); }
  std::int64_t ticks() const { return ticks_; }  ///< how many were taken
  double t() const { return t_; }                ///< of the last one [s]

  /// Adds to a report what the estimates and the events that they come from say of themselves;
  /// tells people in a few lines.
  void sum_up(const EventHistory& events, nlohmann::ordered_json& report) const;

  /// Throws std::runtime_error if something could not be written.
  void close();

 private:
  double initial_bound_;
  std::vector<Output> outputs_;
  bool says_penetrating_ = false;  // the states have that column
  bool bounded_ = false;           // and those of guaranteed half-widths
  std::optional<StatesWriter> states_;
  ConfidenceRecord record_;
  std::vector<double> columns_;
  std::int64_t ticks_ = 0;
  double t_ = 0.0;
};

}  // namespace sprag
