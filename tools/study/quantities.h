// Computes the rows of a study. They are a pure function of the study and the index of a run.
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

/// index, point, run, the axes, n if a run has several rows, the recorded quantities, failure.
std::vector<std::string> columns(const Study& study);

/// Number of rows of a run that does not fail.
int rows_of_run(const Study& study);

/// Computes runs, replicas of several runs at once. Data kept between calls only saves time.
class Measurement {
 public:
  /// `study` must outlive this.
  explicit Measurement(const Study& study);

  /// Appends the rows of the first runs of a nonempty range, each with its end of line. A failed
  /// run is one row with NaN and the reason. Throws Interrupted.
  Computed append_rows(Range range, std::string& text);

 private:
  struct Run;

  const Setting& setting_at(const std::vector<double>& values);
  void begin(Run& run);
  void follow_all(std::vector<Run>& runs) const;
  std::vector<std::vector<double>> recorded(const Run& run) const;
  void append(const Run& run, std::string& text) const;

  const Study& study_;
  std::size_t recorded_;  // number of recorded columns
  std::size_t together_;  // largest number of runs computed at once
  std::vector<double> values_;
  std::unique_ptr<const Setting> setting_;  // for values_
  std::unique_ptr<const Flows> flows_;      // of its machine
};

}  // namespace sprag::study
