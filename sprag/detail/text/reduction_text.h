// The candidates of a reduction as text.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"

namespace sprag {

struct ReductionTable {
  std::string scene;
  int closings = 0;                   ///< that count
  double from = 0.0, to = 0.0;        ///< begin and end of the time in which they count [s]
  std::vector<Reduction> reductions;  ///< the best first; at least one
};

/// The chosen candidate, and a table of all, at most 100 columns.
std::string to_text(const ReductionTable& table);

}  // namespace sprag
