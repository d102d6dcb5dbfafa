// Charts of the results: for each deviation a panel of V of every estimator against the amount,
// with the target; or the error against the number of modes.
#pragma once

#include <filesystem>
#include <string>

#include "sprag/detail/tolerance/search.h"
#include "tools/tolerance/modes.h"

namespace sprag::tolerance {

/// Throws UsageError if the name does not end in .png, .svg or .pdf.
void check_picture(const std::filesystem::path& output);

/// gnuplot script with its data.
std::string chart_script(const Bench& bench, const Tolerances& tolerances,
                         const std::filesystem::path& output);
/// The same for the error against the number of modes.
std::string chart_script(const Bench& bench, const std::vector<FewerModes>& table,
                         const std::filesystem::path& output);

}  // namespace sprag::tolerance
