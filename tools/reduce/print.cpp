#include "tools/reduce/print.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "command_line/printable.h"

namespace sprag {
namespace {

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string modes(int n) { return std::to_string(n) + (n == 1 ? " mode" : " modes"); }

std::string chosen(const Reduction& best) {
  const std::string with = best.correction == "none" ? " alone" : " with " + best.correction;
  return modes(best.modes) + with + (best.modes == 1 ? " follows" : " follow");
}

void append_row(const std::string& correction, const std::string& coordinates,
                const std::string& rms, std::string& text) {
  char row[128];
  std::snprintf(row, sizeof row, "%-36s %11s   %s\n", correction.c_str(), coordinates.c_str(),
                rms.c_str());
  text += row;
}

}  // namespace

std::string to_text(const ReductionTable& table) {
  std::string text = printable(table.scene) + ": " + chosen(table.reductions.front()) +
                     " the events best\n\n" + std::to_string(closings(table.followed)) +
                     " closings from t = " + number(table.followed.counts) + " to " +
                     number(table.followed.events.back().t) +
                     " count; g(t_k) is the replica's own gap there.\n\n";
  append_row("correction", "coordinates", "rms of g(t_k) [m]", text);
  for (const Reduction& reduction : table.reductions) {
    append_row(reduction.correction, std::to_string(reduction.machine.model.coordinates()),
               number(reduction.rms), text);
  }
  return text;
}

void write_json(const ReductionTable& table, nlohmann::ordered_json& object) {
  const Reduction& best = table.reductions.front();
  object["scene"] = table.scene;
  object["modes"] = best.modes;
  object["correction"] = best.correction;
  object["coordinates"] = best.machine.model.coordinates();
  object["rms_gap"] = best.rms;
  object["closings"] = closings(table.followed);
  object["from"] = table.followed.counts;
  object["to"] = table.followed.events.back().t;
  object["candidates"] = nlohmann::ordered_json::array();
  for (const Reduction& reduction : table.reductions) {
    nlohmann::ordered_json entry{{"correction", reduction.correction},
                                 {"coordinates", reduction.machine.model.coordinates()},
                                 {"rms_gap", reduction.rms}};
    if (reduction.share) entry["share"] = *reduction.share;
    if (!reduction.static_vectors.empty()) {
      entry["static_vectors"] = reduction.static_vectors;
      entry["least_damping_ratio"] = reduction.least_zeta;
    }
    object["candidates"].push_back(std::move(entry));
  }
}

}  // namespace sprag
