#include "studies/calibration/table.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "sprag/detail/files/csv.h"

namespace sprag::calibration {
namespace {

const char* name(EstimatorKind estimator) {
  return estimator == EstimatorKind::both ? "both" : "timing";
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    if (!text.empty()) text += ' ';
    text += word;
  }
  return text;
}

// One list for names and values keeps them consistent.
template <typename Field>
void visit(const Row& row, const Field& field) {
  const Summary& of = row.summary;
  field("scene", row.scene);
  field("estimator", std::string(name(row.estimator)));
  field("coordinates", static_cast<std::int64_t>(row.coordinates));
  field("contacts", static_cast<std::int64_t>(row.contacts));
  field("jitter", row.jitter);
  field("omega_sigma", row.omega_sigma);
  field("duration", row.duration);
  field("tick", row.tick);
  field("events", static_cast<std::int64_t>(row.events));
  field("seeds", static_cast<std::int64_t>(row.seeds));
  field("z2", of.state.mean_square());
  field("z2_deviation", of.deviation);
  field("beyond_3_sigma", of.state.beyond());
  field("z2_gaps", of.gaps.mean_square());
  field("beyond_3_sigma_gaps", of.gaps.beyond());
  field("samples", of.state.count());
  field("unknown", of.state.unknown());
  field("not_numbers", of.state.not_numbers() + of.gaps.not_numbers());
  field("V_replica", of.V_replica);
  field("V", of.V);
  field("V_replica_largest", of.V_replica_largest);
  field("V_largest", of.V_largest);
  field("J", of.J);
  field("inconsistencies", of.inconsistencies);
  field("from_filter", of.from_filter);
  field("worse", of.worse);
  field("worse_largest", of.worse_largest);
  field("missed", joined(row.missed));
}

struct CsvLine {
  std::string text;
  void add(const std::string& value) { text += value; }
  template <typename Number>
  void add(Number value) {
    append_number(text, value);
  }
};

}  // namespace

std::string table_header() {
  return "scene               by      f m  jitter  w sigma  events seeds | z2    +-     >3s %  "
         "gaps  "
         ">3s %  | V replica  V         max replica  max      | J      incons.  nan  unknown%  "
         "filter%  worse% (one)  | misses\n";
}

std::string table_row(const Row& row) {
  const Summary& of = row.summary;
  const std::int64_t not_numbers = of.state.not_numbers() + of.gaps.not_numbers();
  const double known = static_cast<double>(of.state.count());
  const double unknown = static_cast<double>(of.state.unknown());
  char line[512];
  std::snprintf(
      line, sizeof line,
      "%-19s %-6s %2d %d  %-7.1g %-8.2g %-6zu %-5d | %-5.3g %-6.2g %-6.3g %-5.3g %-6.3g | "
      "%-10.2g %-9.2g "
      "%-12.2g %-8.2g | %-6.3g %-8lld %-4lld %-9.3g %-8.4g %-6.3g %-6.3g | %s\n",
      row.scene.c_str(), name(row.estimator), static_cast<int>(row.coordinates), row.contacts,
      row.jitter, row.omega_sigma, row.events, row.seeds, of.state.mean_square(), of.deviation,
      100.0 * of.state.beyond(), of.gaps.mean_square(), 100.0 * of.gaps.beyond(), of.V_replica,
      of.V, of.V_replica_largest, of.V_largest, of.J, static_cast<long long>(of.inconsistencies),
      static_cast<long long>(not_numbers), 100.0 * unknown / (known + unknown),
      100.0 * of.from_filter, 100.0 * of.worse, 100.0 * of.worse_largest,
      joined(row.missed).c_str());
  return line;
}

std::string csv_header() {
  std::string line;
  visit(Row{}, [&](const char* field, const auto&) {
    if (!line.empty()) line += ',';
    line += field;
  });
  return line + '\n';
}

std::string csv_row(const Row& row) {
  CsvLine line;
  visit(row, [&](const char*, const auto& value) {
    if (!line.text.empty()) line.text += ',';
    line.add(value);
  });
  return line.text + '\n';
}

nlohmann::ordered_json to_json(const Row& row) {
  nlohmann::ordered_json object;
  visit(row, [&](const char* field, const auto& value) { object[field] = value; });
  return object;
}

}  // namespace sprag::calibration
