// The verdict of an identification in words: one sentence that says whether the events fit, and one
// that gives the reason of a refusal and what to do.
#pragma once

#include <string>

#include "sprag/identification.h"

namespace sprag {

/// The name of a problem in reports: "none", "no_convergence", "events_left_out", ...
const char* name_of(FitProblem problem);

/// One clause without a full stop: "the events fit, with 7 parameters as found".
std::string verdict_of(const Identification& fit);

/// Of a fit that is refused: why, and what to do; else empty.
std::string reason_of(const Identification& fit);

/// A number of `digits` significant digits; -0 is 0.
std::string short_number(double value, int digits);

}  // namespace sprag
