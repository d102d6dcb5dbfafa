// Drawn records for identification: right machines with clean and faulty records, and machines
// outside of the fitted family.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sprag/identification.h"

namespace sprag::identification_study {

struct Record {
  Scene nominal;  ///< off by up to the ranges of the unknowns
  std::vector<ContactEvent> events;
  IdentificationSettings settings;
  std::vector<double> truth;  ///< of each unknown; NaN: the family has no true value
  double jitter = 0.0;        ///< [s]
};

/// Names of the kinds of records. The first `right_kinds` are of machines within the family.
extern const std::vector<std::string> kinds;
extern const std::size_t right_kinds;

/// Keys of all parameters of a scene that events determine: all but amplitudes and constant forces,
/// one restitution if the contacts have the same.
std::vector<std::string> usual_keys(const Scene& scene);

/// Error in the coordinate of the parameter.
double error_of(const Parameter& unknown, double value, double truth);

/// Record number `trial` of a kind. Redraws until the record has enough events.
Record drawn(const std::string& kind, std::uint64_t trial);

}  // namespace sprag::identification_study
