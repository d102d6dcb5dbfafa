// Thresholds of the filter's track (sprag/detail/filter/track.h) by name, for a command line.
#pragma once

#include <string>
#include <string_view>

#include "sprag/detail/filter/track.h"

namespace sprag::calibration {

/// Takes "NAME=VALUE", VALUE > 0. Returns what is wrong with it; empty: nothing, and it is set.
std::string set_threshold(std::string_view given, TrackThresholds& thresholds);

}  // namespace sprag::calibration
