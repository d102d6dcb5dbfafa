// Figures that a report computes from the tables of a run: reported events, innovations of the
// filter, and predicted against measured events. Contacts are counted from 1, as in the files.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tools/plot/table.h"

namespace sprag::report {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

struct ReportedEvent {
  double t = 0.0;  ///< [s]
  int contact = 1;
  double kind = plot::impact_kind;  ///< as in plot::Table
};

/// Events of an events table, whose pulses are two rows, or of an impacts table.
std::vector<ReportedEvent> reported_events(const plot::Table& table);

/// Values with standard deviations over time: measured minus expected.
struct Residuals {
  std::vector<double> t, value, sigma;  ///< sigma not finite: unknown
  std::vector<int> contact;

  std::size_t size() const { return t.size(); }
};

/// value / sigma of those with a sigma > 0; all others are left out, with sigma 1.
Residuals normalized(const Residuals& residuals);

/// Test of standard deviations: the mean square of n normalized residuals, which is 1 if they are
/// right and independent, and the range that contains it in 95 % of such cases.
struct Consistency {
  std::size_t n = 0;
  double mean_square = 0.0, low = 0.0, high = 0.0;
  double within_two = 0.0;  ///< share within 2 sigma

  bool holds() const { return low <= mean_square && mean_square <= high; }
};

/// Nullopt for less than `fewest` residuals.
std::optional<Consistency> consistency(const Residuals& normalized);
inline constexpr std::size_t fewest_residuals = 10;

/// Gap of the filter just before each reported closing, which is 0 for a perfect estimate. A states
/// table has one closing for each tick; others are missing. Empty without a filter.
Residuals innovations(const plot::Table& states);

/// Measured minus predicted time of the next event, for each prediction.
struct PredictionCheck {
  Residuals errors;          ///< of predictions of the contact that closed or opened next
  std::size_t none = 0;      ///< predictions that claim no event
  std::size_t others = 0;    ///< predictions of another contact than the next event's
  std::size_t open_end = 0;  ///< predictions after the last event
};

/// `jitter`: standard deviation of reported times [s].
PredictionCheck check_predictions(const plot::Table& predictions,
                                  const std::vector<ReportedEvent>& events, double jitter);

}  // namespace sprag::report
