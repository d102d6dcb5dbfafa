// Pictures of a report: those of plot in a narrow form, residuals, and a matrix of correlations.
#pragma once

#include <string>
#include <vector>

#include "tools/plot/figure.h"
#include "tools/report/analysis.h"
#include "tools/report/document.h"

namespace sprag::report {

/// Draws a figure in the width of a report.
Picture picture_of(const plot::Figure& figure, const std::string& caption);

/// A panel of residuals over time, a symbol for each contact, with bars of 2 sigma. An empty unit:
/// residuals divided by sigma, with lines at +-2 in place of bars.
plot::Panel residual_panel(const Residuals& residuals, const std::string& quantity,
                           const std::string& unit);

/// One panel over the time of its data, of at least one residual.
Picture residual_picture(const Residuals& residuals, const std::string& quantity,
                         const std::string& unit, const std::string& caption);

/// A square of colours from -1 (blue) to 1 (red) with the numbers in it. `values` has a row for
/// each name; NaN where there is none.
Picture correlation_picture(const std::vector<std::string>& names,
                            const std::vector<std::vector<double>>& values,
                            const std::string& caption);

/// A parameter with its 95 % interval. 0: the scene's value; -1 and 1: the ends of the range within
/// which it was assumed.
struct Interval {
  std::string name, text;  ///< text: the value in words, beside the interval
  double value = 0.0, low = 0.0, high = 0.0;
};

/// A row for each interval, over the assumed range as a band.
Picture interval_picture(const std::vector<Interval>& intervals, const std::string& caption);

}  // namespace sprag::report
