#include "studies/work_precision/results.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "sprag/detail/files/csv.h"

namespace sprag::work_precision {
namespace {

using Json = nlohmann::ordered_json;

const char* name(Kind kind) {
  switch (kind) {
    case Kind::ours:
      return "ours";
    case Kind::rival:
      return "rival";
    case Kind::peer:
      return "peer";
  }
  return "";
}

Json known(double value) { return std::isnan(value) ? Json() : Json(value); }

Json row(const std::string& scene, const Method& method, double setting,
         const Measurement& measurement) {
  const Figures& f = measurement.figures;
  return {{"scene", scene},
          {"method", method.name},
          {"kind", name(method.kind)},
          {"knob", method.knob},
          {"setting", setting},
          {"status", measurement.failure.empty() ? "ok" : "failed"},
          {"found", f.impacts.found},
          {"missed", f.impacts.missed},
          {"invented", f.impacts.invented},
          {"first_missed", known(f.impacts.first_missed)},
          {"median_dt", known(f.impacts.median_dt)},
          {"max_dt", known(f.impacts.max_dt)},
          {"l1_u", known(f.states.l1_u)},
          {"sup_q", known(f.states.sup_q)},
          {"horizon", known(f.states.horizon)},
          {"penetration", known(f.penetration)},
          {"cpu_us_per_time", known(f.cpu_us_per_time)},
          {"steps", f.steps},
          {"solves", f.solves},
          {"right_hand_sides", f.right_hand_sides},
          {"memory_kb", known(f.memory_kb)},
          {"early_found", f.early_impacts.found},
          {"early_missed", f.early_impacts.missed},
          {"early_invented", f.early_impacts.invented},
          {"early_median_dt", known(f.early_impacts.median_dt)},
          {"early_sup_q", known(f.early_states.sup_q)},
          {"reason", measurement.failure}};
}

// The fields of this CSV need no quotes.
std::string plain(std::string text) {
  std::replace(text.begin(), text.end(), ',', ';');
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  return text;
}

std::string csv_line(const Json& row, bool header) {
  std::string line;
  for (const auto& [key, value] : row.items()) {
    if (!line.empty()) line += ',';
    if (header) {
      line += key;
    } else if (value.is_string()) {
      line += plain(value.get<std::string>());
    } else if (value.is_number_float()) {
      append_number(line, value.get<double>());
    } else if (value.is_number_integer()) {
      append_number(line, value.get<std::int64_t>());
    }
  }
  return line + '\n';
}

}  // namespace

Results::Results(const std::filesystem::path& directory) : csv_(directory / "work_precision.csv") {
  csv_.write(csv_line(row("", methods().front(), 0.0, {}), true));
  if (!csv_.flush()) throw std::runtime_error(csv_.error());
}

void Results::add(const std::string& scene, const Method& method, double setting,
                  const Measurement& measurement) {
  csv_.write(csv_line(row(scene, method, setting, measurement), false));
  if (!csv_.flush()) throw std::runtime_error(csv_.error());
  ++rows_;
}

}  // namespace sprag::work_precision
