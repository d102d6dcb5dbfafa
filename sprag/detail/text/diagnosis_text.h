// A diagnosis as text.
#pragma once

#include <string>

#include "sprag/detail/analysis/diagnosis.h"

namespace sprag {

/// The verdict in words.
std::string verdict(const Diagnosis& diagnosis);

/// Verdict and a table of the parameters, the best first, at most 100 columns.
std::string to_text(const Diagnosis& diagnosis);

}  // namespace sprag
