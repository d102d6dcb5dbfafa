// Output of the candidates of a reduction as text and as JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"

namespace sprag {

struct ReductionTable {
  std::string scene;
  Followed followed;
  std::vector<Reduction> reductions;  ///< the best first; at least one
};

/// The chosen candidate, and a table of all, at most 100 columns.
std::string to_text(const ReductionTable& table);

/// Adds all figures without rounding. An infinite rms is null.
void write_json(const ReductionTable& table, nlohmann::ordered_json& object);

}  // namespace sprag
