// Computes the rows of a study. They are a pure function of the study and the index of a run.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/study/design.h"
#include "sprag/detail/study/study_file.h"
#include "sprag/detail/study/trial.h"

namespace sprag::study {

/// index, point, run, the axes, n if a run has several rows, the recorded quantities, failure.
std::vector<std::string> columns(const Study& study);

/// Number of rows of a run that does not fail.
int rows_of_run(const Study& study);

/// A row of a run. A run has one, or with `poincare` one for each of its points, n = 1, 2, ...
struct Row {
  std::int64_t index = 0;
  std::vector<double> axes;      ///< values of the study's axes
  std::int64_t n = 0;            ///< with `poincare`; 0: the run failed
  std::vector<double> recorded;  ///< the recorded quantities; NaN if the run failed
  std::string failure;           ///< empty: none
};

/// Appends the row as a line of a CSV file, in the order of columns().
void append_line(const Study& study, const Row& row, std::string& text);

/// Computes runs. Data kept between calls only saves time.
class Measurement {
 public:
  /// `study` must outlive this.
  explicit Measurement(const Study& study);

  /// Appends the rows of a run. A failed run is one row with the reason, and returns false. Throws
  /// Interrupted.
  bool append_rows(std::int64_t index, std::vector<Row>& rows);
  /// The same as lines of a CSV file.
  bool append_rows(std::int64_t index, std::string& text);

 private:
  struct Run;

  const Setting& setting_at(const std::vector<double>& values);
  void begin(Run& run);
  void follow_all(Run& run) const;
  std::vector<std::vector<double>> recorded(const Run& run) const;
  void append(const Run& run, std::vector<Row>& rows) const;

  const Study& study_;
  std::size_t recorded_;  // number of recorded columns
  std::vector<double> values_;
  std::unique_ptr<const Setting> setting_;  // for values_
  std::unique_ptr<const Flows> flows_;      // of its machine
};

}  // namespace sprag::study
