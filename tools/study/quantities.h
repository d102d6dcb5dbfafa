// The rows of a study: a pure function of the study and the index of a run.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sprag/mechanics/flows.h"
#include "tools/study/design.h"
#include "tools/study/study_file.h"

namespace sprag::study {

/// index, point, run, the axes, n where a run has several rows, what is recorded, failure.
std::vector<std::string> columns(const Study& study);

/// Rows of a run that does not fail.
int rows_of_run(const Study& study);

/// Computes runs, one after the other. What it keeps between them saves time and changes nothing.
class Measurement {
 public:
  /// `study` must outlive this.
  explicit Measurement(const Study& study);

  /// Appends the rows of run `index`, each with its end of line. False where the run has failed: it
  /// is one row then, with NaN and the reason. Throws Interrupted.
  bool append_rows(std::int64_t index, std::string& text);

 private:
  const Setting& setting_at(const std::vector<double>& values);
  void measure(std::int64_t index, const std::vector<double>& values,
               std::vector<std::vector<double>>& rows);
  void append(const Setting& setting, std::uint64_t stream, std::vector<double>& row) const;

  const Study& study_;
  std::size_t recorded_;  // columns
  std::vector<double> values_;
  std::unique_ptr<const Setting> setting_;  // of values_
  std::unique_ptr<const Flows> flows_;      // of its machine
};

}  // namespace sprag::study
