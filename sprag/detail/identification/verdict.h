// Text of an identification's verdict: one sentence says whether the events fit, another gives the
// reason of a refusal and the remedy.
#pragma once

#include <string>

#include "sprag/identification.h"

namespace sprag {

/// Name of a problem in reports: "none", "no_convergence", "events_left_out", ...
const char* name_of(FitProblem problem);

/// Name of a cause in reports: "none", "restitution_by_speed", ...
const char* name_of(Cause cause);

/// One clause without a full stop: "the events fit, with 7 parameters as found".
std::string verdict_of(const Identification& fit);

/// For a refused fit: the reason and the remedy. Else empty.
std::string reason_of(const Identification& fit);

/// The pace of a contact clock with this rate: "200 ppm fast", "3.5 % slow", "true".
std::string pace_of_clock(double rate);

/// A number of `digits` significant digits; -0 is 0.
std::string short_number(double value, int digits);

/// A value to the second significant digit of its standard deviation; without one to six digits.
std::string rounded_to_sigma(double value, double sigma);

}  // namespace sprag
