// Output of settled estimates, live and in a replay: rows of a states CSV, and the record of their
// confidence (confidence_record.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "observer/confidence_record.h"
#include "observer/estimate_sample.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/files/states_file.h"
#include "sprag/model.h"

namespace sprag {

class SettledOutput {
 public:
  /// `states` is empty for no file. `empty` is a sample with all vectors allocated, `initial` is
  /// B(0). Throws std::runtime_error if the file cannot be written.
  SettledOutput(const std::filesystem::path& states, const EstimateSample& empty, double initial,
                std::vector<Output> outputs);

  /// If false, only the last estimate must be complete.
  bool writes_states() const { return states_.has_value(); }

  /// Called tick by tick, in order: take() with a complete estimate, or note() with one that lacks
  /// q, u, standard deviations and bound. conclude() completes the last noted estimate.
  void take(const EstimateSample& settled);
  void note(const EstimateSample& settled);
  void conclude(const EstimateSample& settled);
  /// Counts further ticks, the last one at t [s], without anything to note.
  void pass(std::int64_t ticks, double t);

  /// Writes all rows to the file.
  void flush();

  /// Number of gate failures of the filter.
  std::int64_t inconsistencies() const { return record_.inconsistencies(); }
  std::int64_t ticks() const { return record_.ticks(); }  ///< number of settled ticks
  double t() const { return record_.t(); }                ///< time of the last one [s]

  /// Adds the confidence and the counts of events to a report and prints a summary.
  void sum_up(const EventHistory& events, bool verbose, nlohmann::ordered_json& report) const;

  /// Throws std::runtime_error if a file could not be written completely.
  void close();

 private:
  double initial_bound_;
  std::vector<Output> outputs_;
  bool says_penetrating_ = false;  // the states file has the column `penetrating`
  bool bounded_ = false;           // it has the columns of guaranteed half-widths
  std::optional<StatesWriter> states_;
  ConfidenceRecord record_;
  std::vector<double> columns_;
};

}  // namespace sprag
