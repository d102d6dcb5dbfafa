#include "tools/report/sections.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/identification/verdict.h"
#include "sprag/version.h"

namespace sprag::report {
namespace {

// A word of a command line as a shell reads it.
std::string shell_word(const std::string& word) {
  constexpr const char* plain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=,:+@%";
  if (!word.empty() && word.find_first_not_of(plain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string command_of(const JsonFile& report) {
  const Json* words = at(report.content, "/command");
  if (words == nullptr || !words->is_array()) return "not in the report";
  std::string text = "sprag " + report.program;
  for (const Json& word : *words) {
    if (word.is_string()) text += " " + shell_word(word.get<std::string>());
  }
  return text;
}

void add(std::optional<Section> section, Document& document) {
  if (section) document.sections.push_back(std::move(*section));
}

}  // namespace

std::string rounded(double value, int digits) {
  return std::isfinite(value) ? short_number(value, digits) : "not determined";
}

std::string rounded_to(double value, double sigma) {
  return std::isfinite(value) ? rounded_to_sigma(value, sigma) : "not determined";
}

Section provenance_section(const Inputs& inputs) {
  Section section{"Files, versions and command lines", {}};
  TextTable files{"Files of this report", {"file", "content", "damage"}, {}};
  for (const ReadFile& file : inputs.files) {
    files.rows.push_back({file.name, file.content, file.damage.empty() ? "none" : file.damage});
  }
  section.blocks.emplace_back(std::move(files));
  TextTable programs{"Programs that wrote a report", {"program", "version", "exit", "command"}, {}};
  for (const JsonFile& report : inputs.reports) {
    const std::string version = text_at(report.content, "/version");
    programs.rows.push_back({report.program, version.empty() ? "not in the report" : version,
                             count_at(report.content, "/exit"), command_of(report)});
  }
  if (!programs.rows.empty()) section.blocks.emplace_back(std::move(programs));
  section.blocks.emplace_back(
      Paragraph{"CSV files have no version and no command line. "
                "--report of each program writes both."});
  return section;
}

Document make_document(const Inputs& inputs, const std::string& title, Shown shown) {
  Document document;
  document.title = title.empty() ? inputs.scene.name : title;
  for (const JsonFile& report : inputs.reports) {
    if (report.program == "identify") {
      document.verdicts.push_back(verdict_of_identification(report));
    }
  }
  for (const ObserverRun& run : inputs.runs()) {
    document.verdicts.push_back(verdict_of_run(run, inputs));
  }
  if (document.verdicts.empty()) {
    document.verdicts.push_back({"Verdict", "Not determined.",
                                 "Neither an estimate of the observer nor a report of observer or "
                                 "identify is among the files.",
                                 Tone::neutral});
  }
  document.sections.push_back(machine_section(inputs.scene));
  document.sections.push_back(measurement_section(inputs));
  for (const JsonFile& report : inputs.reports) {
    if (report.program != "identify") continue;
    document.sections.push_back(identification_section(report, inputs.scene));
  }
  add(motion_section(inputs, shown), document);
  add(residuals_section(inputs), document);
  add(impacts_section(inputs, shown), document);
  add(certainty_section(inputs, shown), document);
  add(inconsistencies_section(inputs), document);
  document.sections.push_back(provenance_section(inputs));
  return document;
}

}  // namespace sprag::report
