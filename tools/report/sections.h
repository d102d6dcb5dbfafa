// The sections of a report and its verdicts. Numbers are those of the files, rounded; what the
// files do not give is "not determined".
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tools/report/document.h"
#include "tools/report/inputs.h"

namespace sprag::report {

/// Longest table of single events; a longer one is cut.
inline constexpr std::size_t most_rows = 100;

/// Time that the pictures show.
struct Shown {
  double from = -std::numeric_limits<double>::infinity();
  double to = std::numeric_limits<double>::infinity();
};

/// A number of `digits` significant digits; "not determined" if it is not finite.
std::string rounded(double value, int digits = 4);
/// The same with the digits that `sigma` supports.
std::string rounded_to(double value, double sigma);

/// `verdict` and the reason, or the check of the prediction, of a report of identify.
Verdict verdict_of_identification(const JsonFile& identification);
/// Whether the filter fits the events, and what is known of the state at the end.
Verdict verdict_of_run(const ObserverRun& run, const Inputs& inputs);

Section machine_section(const Scene& scene);
Section measurement_section(const Inputs& inputs);
Section identification_section(const JsonFile& identification, const Scene& scene);
/// Gaps, outputs and contacts over time.
std::optional<Section> motion_section(const Inputs& inputs, Shown shown);
/// Innovations and predictions.
std::optional<Section> residuals_section(const Inputs& inputs);
std::optional<Section> impacts_section(const Inputs& inputs, Shown shown);
/// V, the bound B, and what is known at the end.
std::optional<Section> certainty_section(const Inputs& inputs, Shown shown);
std::optional<Section> inconsistencies_section(const Inputs& inputs);
Section provenance_section(const Inputs& inputs);

/// The whole report. An empty title: the scene's name.
Document make_document(const Inputs& inputs, const std::string& title, Shown shown);

}  // namespace sprag::report
