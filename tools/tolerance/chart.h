// Pictures of what was found: a panel for each thing that may be off, V of every estimator against
// its amount, and the target; or the error against the modes that are kept.
#pragma once

#include <filesystem>
#include <string>

#include "tools/tolerance/modes.h"
#include "tools/tolerance/search.h"

namespace sprag::tolerance {

/// Throws UsageError where the name does not end in .png, .svg or .pdf.
void check_picture(const std::filesystem::path& output);

/// gnuplot's scripts, data included.
std::string chart_script(const Bench& bench, const Tolerances& tolerances,
                         const std::filesystem::path& output);
/// The error against the modes that are kept.
std::string chart_script(const Bench& bench, const std::vector<FewerModes>& table,
                         const std::filesystem::path& output);

}  // namespace sprag::tolerance
