#include "sprag/detail/text/diagnosis_text.h"

#include <array>
#include <cmath>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/text/printable.h"
#include "sprag/detail/text/table.h"

namespace sprag {
namespace {

constexpr double nearly_all = 0.9999;
// Of the misfit: smaller explained shares are not reported.
constexpr double least_reported_share = 0.5;

std::string with_unit(double value, int digits, const std::string& unit) {
  return short_number(value, digits) + (unit.empty() ? "" : " " + unit);
}

std::string percent_explained(double share) {
  return share > nearly_all ? "more than 99.99 %" : short_number(100.0 * share, 4) + " %";
}

std::string instead(const Candidate& candidate) {
  const Parameter& parameter = candidate.parameter;
  if (parameter.key == "clock.rate") {
    return "a contact clock that is " + pace_of_clock(candidate.value) + " (rate " +
           short_number(candidate.value, 8) + " instead of " + short_number(parameter.nominal, 8) +
           ')';
  }
  return parameter.key + ' ' + short_number(candidate.value, 6) + " instead of " +
         with_unit(parameter.nominal, 6, parameter.unit);
}

std::string change_text(const Candidate& candidate) {
  const Parameter& parameter = candidate.parameter;
  if (!parameter.relative) return short_number(candidate.change(), 3);
  return short_number(100.0 * candidate.change() / std::abs(parameter.nominal), 3) + " %";
}

std::string offset_text(const Diagnosis& diagnosis) {
  if (diagnosis.has_record) {
    return "An offset of the clock is a delay of the recorded input. The rate of the clock is "
           "taken "
           "as known.\n";
  }
  const Candidate* phase = diagnosis.phase();
  if (phase == nullptr) {
    return "The machine does not depend on t: an offset of the clock cannot be determined.\n";
  }
  if (!(diagnosis.only_frequency > 0.0)) return "";
  std::string text =
      "With one frequency an offset of the clock cannot be distinguished from a change of the "
      "phase";
  if (phase->determined && phase->change() != 0.0) {
    text += ": " + short_number(phase->change(), 3) + " rad is " +
            short_number(-phase->change() / diagnosis.only_frequency, 3) + " s";
  }
  return text + ".\n";
}

std::string clock_text(const Diagnosis& diagnosis) {
  std::string text = offset_text(diagnosis);
  if (!diagnosis.rate_ambiguity.empty()) text += diagnosis.rate_ambiguity + '\n';
  return text;
}

constexpr std::array<std::size_t, 6> columns{25, 10, 22, 11, 11, 11};

void append_table(const Diagnosis& diagnosis, std::string& text) {
  append_row(text, columns,
             {"parameter", "nominal", "best", "change", "left [s]", "explained", "sensitivity"});
  for (const Candidate& candidate : diagnosis.candidates) {
    const Parameter& parameter = candidate.parameter;
    const std::string nominal = short_number(parameter.nominal, 6);
    if (!candidate.determined) {
      append_row(text, columns, {parameter.key, nominal, "not determined"});
      continue;
    }
    const int digits = parameter.key == "clock.rate" ? 8 : 6;
    append_row(
        text, columns,
        {parameter.key, nominal,
         short_number(candidate.value, digits) + " +- " + short_number(candidate.deviation, 2),
         change_text(candidate), short_number(candidate.scatter, 3),
         short_number(100.0 * candidate.explained, 4) + " %",
         short_number(candidate.sensitivity, 3)});
  }
}

}  // namespace

std::string verdict(const Diagnosis& diagnosis) {
  if (diagnosis.fits) return "events fit the model";
  if (diagnosis.is_repaired()) {
    const std::size_t lost = diagnosis.missing.size(), spurious = diagnosis.spurious.size();
    const auto events = [](std::size_t n) {
      return std::to_string(n) + (n == 1 ? " event is" : " events are");
    };
    std::string text;
    if (lost > 0) text += events(lost) + " lost";
    if (lost > 0 && spurious > 0) text += " and ";
    if (spurious > 0) text += events(spurious) + " spurious";
    return text + "; otherwise the events fit the model";
  }
  if (const Candidate* best = diagnosis.explanation()) {
    if (!(best->explained > 0.0)) return instead(*best) + " fits significantly better";
    return instead(*best) + " explains " + percent_explained(best->explained) + " of the misfit";
  }
  std::string text = "no single parameter explains the misfit";
  if (diagnosis.candidates.empty()) return text;
  const Candidate& best = diagnosis.candidates.front();
  if (best.determined && best.explained > least_reported_share) {
    text += "; the best is " + instead(best) + ", which ";
    text += best.improved_by.empty() ? "leaves " + short_number(best.scatter, 3) + " s"
                                     : "with another " + best.improved_by + " does better";
  } else {
    text += "; event times with a jitter of " + short_number(diagnosis.scatter, 3) + " s would";
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
            " near t = " + short_number(impact.t, 6) + '\n';
  }
  for (const ContactEvent& event : diagnosis.spurious) {
    text += "  spurious: the event of contact " + std::to_string(event.contact + 1) +
            " at t = " + short_number(event.t, 8) + '\n';
  }
  text += '\n' + std::to_string(diagnosis.closings) +
          " closings from t = " + short_number(diagnosis.from, 4) + " to " +
          short_number(diagnosis.to, 4) + ", event times ";
  text += diagnosis.jitter > 0.0 ? "with a jitter of " + short_number(diagnosis.jitter, 3) + " s.\n"
                                 : "as exact.\n";
  if (diagnosis.misfit <= diagnosis.largest_misfit && !diagnosis.is_repaired()) {
    text += "The model as it is predicts them: mean square " + short_number(diagnosis.misfit, 3) +
            " of the expected one.\n";
  } else {
    text +=
        "The model as it is follows them to within " + short_number(diagnosis.scatter, 3) + " s.\n";
  }
  if (!diagnosis.fits && diagnosis.unsure > 0) {
    text += "Of " + std::to_string(diagnosis.unsure) +
            " impacts with several contacts not all is known: part of the misfit may be theirs.\n";
  }
  text += '\n';
  append_table(diagnosis, text);
  return text + '\n' + clock_text(diagnosis);
}

}  // namespace sprag
