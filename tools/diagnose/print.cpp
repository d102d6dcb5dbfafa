#include "tools/diagnose/print.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "command_line/printable.h"
#include "sprag/detail/identification/verdict.h"

namespace sprag {
namespace {

constexpr double nearly_all = 0.9999;
// Of the misfit: smaller explained shares are not reported.
constexpr double least_reported_share = 0.5;

std::string number(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

std::string with_unit(double value, int digits, const std::string& unit) {
  return number(value, digits) + (unit.empty() ? "" : " " + unit);
}

std::string percent(double share) {
  return share > nearly_all ? "more than 99.99 %" : number(100.0 * share, 4) + " %";
}

double change(const Candidate& candidate) { return candidate.value - candidate.parameter.nominal; }

std::string instead(const Candidate& candidate) {
  const Parameter& parameter = candidate.parameter;
  if (parameter.quantity == Quantity::clock_rate) {
    return "a contact clock that is " + pace_of_clock(candidate.value) + " (rate " +
           number(candidate.value, 8) + " instead of " + number(parameter.nominal, 8) + ')';
  }
  return parameter.name + ' ' + number(candidate.value, 6) + " instead of " +
         with_unit(parameter.nominal, 6, parameter.unit);
}

std::string change_text(const Candidate& candidate) {
  const Parameter& parameter = candidate.parameter;
  if (!parameter.relative) return number(change(candidate), 3);
  return number(100.0 * change(candidate) / std::abs(parameter.nominal), 3) + " %";
}

const Candidate* phase_of(const Diagnosis& diagnosis) {
  for (const Candidate& candidate : diagnosis.candidates) {
    if (candidate.parameter.quantity == Quantity::phase) return &candidate;
  }
  return nullptr;
}

std::string offset_text(const Diagnosis& diagnosis) {
  if (diagnosis.has_record) {
    return "An offset of the clock is a delay of the recorded input. The rate of the clock is "
           "taken "
           "as known.\n";
  }
  const Candidate* phase = phase_of(diagnosis);
  if (phase == nullptr) {
    return "The machine does not depend on t: an offset of the clock cannot be determined.\n";
  }
  if (!(diagnosis.only_frequency > 0.0)) return "";
  std::string text =
      "With one frequency an offset of the clock cannot be distinguished from a change of the "
      "phase";
  if (phase->determined && change(*phase) != 0.0) {
    text += ": " + number(change(*phase), 3) + " rad is " +
            number(-change(*phase) / diagnosis.only_frequency, 3) + " s";
  }
  return text + ".\n";
}

std::string clock_text(const Diagnosis& diagnosis) {
  std::string text = offset_text(diagnosis);
  if (!diagnosis.rate_ambiguity.empty()) text += diagnosis.rate_ambiguity + '\n';
  return text;
}

void append_row(const std::vector<std::string>& cells, std::string& text) {
  constexpr std::size_t widths[] = {25, 10, 22, 11, 11, 11};
  std::string row;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    std::string cell = cells[i];
    if (i + 1 < cells.size()) cell.resize(std::max(widths[i], cell.size() + 1), ' ');
    row += cell;
  }
  text += row + '\n';
}

void append_table(const Diagnosis& diagnosis, std::string& text) {
  append_row({"parameter", "nominal", "best", "change", "left [s]", "explained", "sensitivity"},
             text);
  for (const Candidate& candidate : diagnosis.candidates) {
    const Parameter& parameter = candidate.parameter;
    const std::string nominal = number(parameter.nominal, 6);
    if (!candidate.determined) {
      append_row({parameter.name, nominal, "not determined"}, text);
      continue;
    }
    const int digits = parameter.quantity == Quantity::clock_rate ? 8 : 6;
    append_row({parameter.name, nominal,
                number(candidate.value, digits) + " +- " + number(candidate.deviation, 2),
                change_text(candidate), number(candidate.scatter, 3),
                number(100.0 * candidate.explained, 4) + " %", number(candidate.sensitivity, 3)},
               text);
  }
}

}  // namespace

std::string verdict(const Diagnosis& diagnosis) {
  if (diagnosis.fits) return "events fit the model";
  if (diagnosis.is_repaired()) {
    const std::size_t lost = diagnosis.missing.size(), spurious = diagnosis.spurious.size();
    std::string text;
    if (lost > 0)
      text += std::to_string(lost) + (lost == 1 ? " event is" : " events are") + " lost";
    if (lost > 0 && spurious > 0) text += " and ";
    if (spurious > 0) {
      text +=
          std::to_string(spurious) + (spurious == 1 ? " event is" : " events are") + " spurious";
    }
    return text + "; otherwise the events fit the model";
  }
  if (const Candidate* best = diagnosis.explanation()) {
    if (!(best->explained > 0.0)) return instead(*best) + " fits significantly better";
    return instead(*best) + " explains " + percent(best->explained) + " of the misfit";
  }
  std::string text = "no single parameter explains the misfit";
  if (diagnosis.candidates.empty()) return text;
  const Candidate& best = diagnosis.candidates.front();
  if (best.determined && best.explained > least_reported_share) {
    text += "; the best is " + instead(best) + ", which ";
    text += best.improved_by.empty() ? "leaves " + number(best.scatter, 3) + " s"
                                     : "with another " + best.improved_by + " does better";
  } else {
    text += "; event times with a jitter of " + number(diagnosis.scatter, 3) + " s would";
  }
  return text;
}

std::string to_text(const Diagnosis& diagnosis) {
  std::string text = printable(diagnosis.scene) + ": " + verdict(diagnosis) + '\n';
  for (const Candidate* tie : diagnosis.ties()) {
    text += "  " + instead(*tie) + " explains it as well\n";
  }
  for (const MissingImpact& impact : diagnosis.missing) {
    text += "  lost: an impact of contact " + std::to_string(impact.contact + 1) +
            " near t = " + number(impact.t, 6) + '\n';
  }
  for (const ContactEvent& event : diagnosis.spurious) {
    text += "  spurious: the event of contact " + std::to_string(event.contact + 1) +
            " at t = " + number(event.t, 8) + '\n';
  }
  text += '\n' + std::to_string(diagnosis.closings) +
          " closings from t = " + number(diagnosis.from, 4) + " to " + number(diagnosis.to, 4) +
          ", event times ";
  text += diagnosis.jitter > 0.0 ? "with a jitter of " + number(diagnosis.jitter, 3) + " s.\n"
                                 : "as exact.\n";
  if (diagnosis.misfit <= diagnosis.largest_misfit) {
    text += "The model as it is predicts them: mean square " + number(diagnosis.misfit, 3) +
            " of the expected one.\n";
  } else {
    text += "The model as it is follows them to within " + number(diagnosis.scatter, 3) + " s.\n";
  }
  if (!diagnosis.fits && diagnosis.unsure > 0) {
    text += "Of " + std::to_string(diagnosis.unsure) +
            " impacts with several contacts not all is known: part of the misfit may be theirs.\n";
  }
  text += '\n';
  append_table(diagnosis, text);
  return text + '\n' + clock_text(diagnosis);
}

void write_json(const Diagnosis& diagnosis, nlohmann::ordered_json& object) {
  object["scene"] = diagnosis.scene;
  object["verdict"] = verdict(diagnosis);
  object["fits"] = diagnosis.fits;
  object["closings"] = diagnosis.closings;
  object["from"] = diagnosis.from;
  object["to"] = diagnosis.to;
  object["jitter"] = diagnosis.jitter;
  object["unsure_impacts"] = diagnosis.unsure;
  object["misfit"] = diagnosis.misfit;
  object["largest_misfit"] = diagnosis.largest_misfit;
  object["scatter"] = diagnosis.scatter;
  object["common_scatter"] = diagnosis.common_scatter;
  object["misfit_before"] = diagnosis.misfit_before;
  const Candidate* best = diagnosis.explanation();
  object["explanation"] = nullptr;
  if (best != nullptr) object["explanation"] = best->parameter.name;
  object["missing"] = nlohmann::ordered_json::array();
  for (const MissingImpact& impact : diagnosis.missing) {
    object["missing"].push_back({{"t", impact.t}, {"contact", impact.contact + 1}});
  }
  object["spurious"] = nlohmann::ordered_json::array();
  for (const ContactEvent& event : diagnosis.spurious) {
    object["spurious"].push_back({{"t", event.t}, {"contact", event.contact + 1}});
  }
  object["ties"] = nlohmann::ordered_json::array();
  for (const Candidate* tie : diagnosis.ties()) object["ties"].push_back(tie->parameter.name);
  object["parameters"] = nlohmann::ordered_json::array();
  for (const Candidate& candidate : diagnosis.candidates) {
    const Parameter& parameter = candidate.parameter;
    nlohmann::ordered_json entry{{"parameter", parameter.name}, {"unit", parameter.unit}};
    if (parameter.contact >= 0) entry["contact"] = parameter.contact + 1;
    entry["nominal"] = parameter.nominal;
    entry["told"] = candidate.determined;
    if (candidate.determined) {
      entry["value"] = candidate.value;
      entry["deviation"] = candidate.deviation;
      entry["change"] = change(candidate);
      if (parameter.relative) {
        entry["change_percent"] = 100.0 * change(candidate) / std::abs(parameter.nominal);
      }
      entry["scatter"] = candidate.scatter;
      entry["misfit_after"] = candidate.misfit;
      entry["gain"] = candidate.gain;
      entry["explained"] = candidate.explained;
      entry["improved_by"] = candidate.improved_by;
      entry["sensitivity"] = candidate.sensitivity;
    }
    object["parameters"].push_back(std::move(entry));
  }
  const Candidate* phase = phase_of(diagnosis);
  if (phase != nullptr && phase->determined && diagnosis.only_frequency > 0.0) {
    object["clock_offset_instead_of_phase"] = -change(*phase) / diagnosis.only_frequency;
  }
}

}  // namespace sprag
