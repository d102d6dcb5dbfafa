#include "sprag/detail/text/reduction_text.h"

#include <cstdio>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/text/printable.h"

namespace sprag {
namespace {

std::string modes_text(int n) { return std::to_string(n) + (n == 1 ? " mode" : " modes"); }

std::string chosen(const Reduction& best) {
  const std::string with = best.correction == "none" ? " alone" : " with " + best.correction;
  return modes_text(best.modes) + with + (best.modes == 1 ? " follows" : " follow");
}

void append_candidate(const std::string& correction, const std::string& coordinates,
                      const std::string& rms, std::string& text) {
  char row[128];
  std::snprintf(row, sizeof row, "%-36s %11s   %s\n", correction.c_str(), coordinates.c_str(),
                rms.c_str());
  text += row;
}

}  // namespace

std::string to_text(const ReductionTable& table) {
  std::string text =
      printable(table.scene) + ": " + chosen(table.reductions.front()) + " the events best\n\n" +
      std::to_string(table.closings) + " closings from t = " + short_number(table.from, 4) +
      " to " + short_number(table.to, 4) + " count; g(t_k) is the replica's own gap there.\n\n";
  append_candidate("correction", "coordinates", "rms of g(t_k) [m]", text);
  for (const Reduction& reduction : table.reductions) {
    append_candidate(reduction.correction, std::to_string(reduction.machine.model.coordinates()),
                     short_number(reduction.rms, 4), text);
  }
  return text;
}

}  // namespace sprag
