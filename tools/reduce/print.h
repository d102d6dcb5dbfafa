// The candidates of a reduction, for people and for machines.
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

/// The chosen one, and all of them in a table, at most 100 columns.
std::string to_text(const ReductionTable& table);

/// Adds all figures, exact. An rms that is infinite is null.
void write_json(const ReductionTable& table, nlohmann::ordered_json& object);

}  // namespace sprag
