#include "studies/calibration/thresholds.h"

#include <cstdint>
#include <map>

#include "sprag/detail/files/csv.h"

namespace sprag::calibration {

std::string set_threshold(std::string_view given, TrackThresholds& of) {
  const std::map<std::string_view, double*> values{{"innovation", &of.innovation},
                                                   {"mean_innovation", &of.mean_innovation},
                                                   {"window", &of.window},
                                                   {"energy_to_accept", &of.energy_to_accept},
                                                   {"least_inflation", &of.least_inflation},
                                                   {"far", &of.far},
                                                   {"long_inside", &of.long_inside}};
  const std::map<std::string_view, std::int64_t*> counts{{"trial", &of.trial},
                                                         {"longest_trial", &of.longest_trial}};
  const std::size_t equals = given.find('=');
  const std::string_view name = given.substr(0, equals);
  const auto number =
      parse_double(equals == given.npos ? std::string_view() : given.substr(equals + 1));
  if (!number || !(*number > 0.0)) {
    return std::string(given) + " is not NAME=VALUE with a positive value";
  }
  if (const auto value = values.find(name); value != values.end()) {
    *value->second = *number;
  } else if (const auto count = counts.find(name); count != counts.end()) {
    *count->second = static_cast<std::int64_t>(*number);
  } else {
    return std::string(name) + " is none of sprag/detail/filter/track.h";
  }
  return {};
}

}  // namespace sprag::calibration
