// An identification for people and for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/identification/explanations.h"

namespace sprag {

struct IdentifyResult {
  std::string scene;
  Identification fit;
  bool accepted = false;          ///< although it does not fit, since the user says so
  bool asked_for_causes = false;  ///< whether `causes` were looked for
  Explanations causes;
  std::string held;  ///< what is held for its scale; empty: nothing
  std::vector<ContactEvent> events;
};

/// Whether the machine drifts from its model.
inline bool drifts(const IdentifyResult& result) { return result.fit.departure.is_drift(); }

/// What follows from it, in words.
std::string verdict(const IdentifyResult& result);

/// Verdict and a table of the parameters, at most 100 columns.
std::string to_text(const IdentifyResult& result);

/// Adds all figures, exact.
void write_json(const IdentifyResult& result, nlohmann::ordered_json& object);

}  // namespace sprag
