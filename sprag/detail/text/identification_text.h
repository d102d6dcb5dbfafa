// An identification as text.
#pragma once

#include <string>

#include "sprag/detail/identification/request.h"

namespace sprag {

/// The verdict in words.
std::string verdict(const IdentifyResult& result);

/// Verdict and a table of the parameters, at most 100 columns.
std::string to_text(const IdentifyResult& result);

}  // namespace sprag
