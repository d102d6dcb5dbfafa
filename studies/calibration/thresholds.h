// Thresholds of the filter's track (sprag/detail/filter/track.h) by name, for a command line.
#pragma once

#include <string>
#include <string_view>

#include "sprag/detail/filter/track.h"

namespace sprag::calibration {

/// Sets "NAME=VALUE", VALUE > 0. Returns an error message, or an empty string on success.
std::string set_threshold(std::string_view given, TrackThresholds& thresholds);

}  // namespace sprag::calibration
