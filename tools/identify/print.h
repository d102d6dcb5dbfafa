// An identification for people and for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sprag/identification/drift.h"
#include "sprag/identification/identification.h"
#include "sprag/identification/restitution_trend.h"

namespace sprag {

struct IdentifyResult {
  std::string scene;
  Identification fit;
  bool accepted = false;          ///< although it does not fit, since the user says so
  bool asked_for_causes = false;  ///< whether `causes` were looked for
  Explanations causes;
  std::optional<DriftEstimate> drift;     ///< none: the fit does not tell
  std::optional<RestitutionTrend> trend;  ///< likewise
  std::string held;                       ///< what is held for its scale; empty: nothing
  std::vector<ContactEvent> events;
};

/// Whether the machine departs from its model.
inline bool drifts(const IdentifyResult& result) { return result.drift && result.drift->found(); }

/// What follows from it, in words.
std::string verdict(const IdentifyResult& result);

/// Verdict and a table of the parameters, at most 100 columns.
std::string to_text(const IdentifyResult& result);

/// Adds all figures, exact.
void to_json(const IdentifyResult& result, nlohmann::ordered_json& object);

}  // namespace sprag
