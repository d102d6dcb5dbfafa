// The rows of a study: a pure function of the study and the index of a run.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/flows.h"
#include "tools/study/design.h"
#include "tools/study/schedule.h"
#include "tools/study/study_file.h"
#include "tools/study/trial.h"

namespace sprag::study {

/// index, point, run, the axes, n where a run has several rows, what is recorded, failure.
std::vector<std::string> columns(const Study& study);

/// Rows of a run that does not fail.
int rows_of_run(const Study& study);

/// Computes runs, some of them side by side. What it keeps between them saves time and changes
/// nothing.
class Measurement {
 public:
  /// `study` must outlive this.
  explicit Measurement(const Study& study);

  /// Appends the rows of the first runs of a range that is not empty, each row with its end of
  /// line. A run that has failed is one row, with NaN and the reason. Throws Interrupted.
  Computed append_rows(Range range, std::string& text);

 private:
  struct Run;

  const Setting& setting_at(const std::vector<double>& values);
  void begin(Run& run);
  void follow_all(std::vector<Run>& runs) const;
  std::vector<std::vector<double>> recorded(const Run& run) const;
  void append(const Run& run, std::string& text) const;

  const Study& study_;
  std::size_t recorded_;  // columns
  std::size_t together_;  // most runs side by side
  std::vector<double> values_;
  std::unique_ptr<const Setting> setting_;  // of values_
  std::unique_ptr<const Flows> flows_;      // of its machine
};

}  // namespace sprag::study
