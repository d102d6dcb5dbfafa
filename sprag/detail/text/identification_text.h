// An identification as text.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/identification/explanations.h"

namespace sprag {

struct IdentifyResult {
  std::string scene;
  Identification fit;
  bool accepted = false;          ///< set by the user: the fit is written although it was refused
  bool asked_for_causes = false;  ///< whether `causes` were searched
  Explanations causes;
  std::string held;  ///< key that is held to fix the scale; empty: none
  std::vector<ContactEvent> events;
};

/// Whether a significant drift was found.
inline bool drifts(const IdentifyResult& result) { return result.fit.departure.is_drift(); }

/// The verdict in words.
std::string verdict(const IdentifyResult& result);

/// Verdict and a table of the parameters, at most 100 columns.
std::string to_text(const IdentifyResult& result);

}  // namespace sprag
