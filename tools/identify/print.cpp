#include "tools/identify/print.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double hides = 0.8;   // a correlation that is worth telling
constexpr double exact = 1e-8;  // of the usual time between impacts: no jitter

std::string number(double value, int digits) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.*g", digits, value == 0.0 ? 0.0 : value);
  return buffer;
}

// As many digits as sigma leaves, and at most what people read.
std::string rounded(double value, double sigma) {
  if (!(sigma > 0.0) || value == 0.0) return number(value, 8);
  const double digits = std::ceil(std::log10(std::abs(value) / sigma)) + 1.0;
  return number(value, static_cast<int>(std::clamp(digits, 2.0, 8.0)));
}

std::string change_of(const FittedUnknown& fitted) {
  const double change = fitted.value - fitted.unknown.nominal;
  if (fitted.unknown.nominal == 0.0 || fitted.unknown.kind == Kind::phase) {
    return number(change, 3);
  }
  return number(100.0 * change / std::abs(fitted.unknown.nominal), 3) + " %";
}

std::string note_of(const IdentifyResult& result, const FittedUnknown& fitted) {
  if (!fitted.determined) return "cannot be told";
  if (fitted.partner < 0 || std::abs(fitted.correlation) < hides) return "";
  return number(fitted.correlation, 2) + " with " +
         result.fit.unknowns[static_cast<std::size_t>(fitted.partner)].unknown.key;
}

void append_row(const std::vector<std::string>& cells, std::string& text) {
  constexpr std::size_t widths[] = {25, 12, 24, 11};
  std::string row;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    std::string cell = cells[i];
    if (i + 1 < cells.size()) cell.resize(std::max(widths[i], cell.size() + 1), ' ');
    row += cell;
  }
  while (!row.empty() && row.back() == ' ') row.pop_back();
  text += row + '\n';
}

void append_table(const IdentifyResult& result, std::string& text) {
  append_row({"parameter", "nominal", "fitted", "change", "hides"}, text);
  for (const FittedUnknown& fitted : result.fit.unknowns) {
    const std::string value =
        fitted.determined ? rounded(fitted.value, fitted.sigma) + " +- " + number(fitted.sigma, 2)
                          : "-";
    append_row({fitted.unknown.key, number(fitted.unknown.nominal, 6), value,
                fitted.determined ? change_of(fitted) : "", note_of(result, fitted)},
               text);
  }
}

std::string plural(std::size_t n, const std::string& what) {
  return std::to_string(n) + ' ' + what + (n == 1 ? "" : "s");
}

std::string instead(const Explanation& cause) {
  std::string text;
  for (const FittedUnknown& fitted : cause.fit.unknowns) {
    if (!text.empty()) text += " and ";
    text += fitted.unknown.key + ' ' + rounded(fitted.value, fitted.sigma) + " instead of " +
            number(fitted.unknown.nominal, 6);
  }
  return text;
}

std::string reason(const Identification& fit) {
  constexpr double much = 2e-3;  // of the usual interval
  switch (fit.problem) {
    case FitProblem::misfit:
      if (fit.scatter > much * fit.interval) {
        return "The likeliest reasons: too few modes, a parameter that is off by more than "
               "--within, "
               "or one that is not sought.";
      }
      return fit.jitter_told
                 ? "The likeliest reasons: a larger jitter than " + number(fit.jitter, 3) +
                       " s, or a small effect that the scene does not have."
                 : "The likeliest reason: a minimum that was not reached; try a smaller --within, "
                   "or "
                   "fewer parameters.";
    case FitProblem::from_inside:
      return "It would be inside a support between its impacts. The likeliest reasons: events that "
             "were lost, or the wrong one of several minima; try another --within.";
    case FitProblem::unpredictable:
      return "What fits the first four fifths does not predict the last. The likeliest reason: "
             "something that changes meanwhile.";
    case FitProblem::not_found:
      return "No parameters were found at which the machine has such impacts.";
    default:
      return "";
  }
}

void append_causes(const IdentifyResult& result, std::string& text) {
  if (!result.asked_for_causes) return;
  const auto& simplest = result.causes.simplest;
  if (simplest.empty()) {
    text += "No one and no two of the parameters alone explain them.\n";
    return;
  }
  if (simplest.front().keys.empty()) {
    text += "The scene as it is explains them, but for the start.\n";
    return;
  }
  text += instead(simplest.front()) +
          (simplest.front().keys.size() > 1 ? " alone explain" : " alone explains") + " them.\n";
  constexpr std::size_t most = 4;
  for (std::size_t i = 1; i < std::min(simplest.size(), most); ++i) {
    text += "  " + instead(simplest[i]) + " as well\n";
  }
}

void append_drift(const IdentifyResult& result, std::string& text) {
  if (!result.drift) return;
  const DriftEstimate& drift = *result.drift;
  if (drifts(result)) {
    text += "The machine drifts from its model: drift " + number(drift.drift, 2) + " (" +
            number(drift.low, 2) + " to " + number(drift.high, 2) + "), the jitter then " +
            number(drift.jitter, 3) + " s.\n";
  } else if (drift.high > 0.0) {
    text += "No drift from the model is seen; it is below " + number(drift.high, 2) + ".\n";
  }
}

// Unless a drift explains more of what is left.
void append_trend(const IdentifyResult& result, std::string& text) {
  if (!result.trend) return;
  const RestitutionTrend& trend = *result.trend;
  const bool of_drift = drifts(result) && result.drift->gain > trend.gain;
  if (!trend.found() || of_drift) {
    text += "That the restitution depends on the impact's speed is not seen: " +
            rounded(trend.trend, trend.sigma) + " +- " + number(trend.sigma, 2) +
            " per unit of it" + (trend.found() ? ", which the drift explains better.\n" : ".\n");
    return;
  }
  text += std::string("Restitution ") + (trend.trend < 0.0 ? "falls" : "rises") + " by " +
          rounded(std::abs(trend.trend), trend.sigma) + " +- " + number(trend.sigma, 2) +
          " per unit of the impact's speed: chi^2 falls from " + number(trend.chi2_without, 4) +
          " to " + number(trend.chi2_with, 4) + ".\n";
}

void append_events(const IdentifyResult& result, std::string& text) {
  for (const std::size_t i : result.fit.spurious) {
    const ContactEvent& event = result.events[i];
    text += "Spurious: t = " + number(event.t, 8) + ", contact " +
            std::to_string(event.contact + 1) + ".\n";
  }
  for (const MissingImpact& missing : result.fit.missing) {
    text += "Missing: an impact of contact " + std::to_string(missing.contact + 1) +
            " near t = " + number(missing.t, 6) + ".\n";
  }
}

std::string list(const Eigen::VectorXd& values, const Eigen::VectorXd& sigmas) {
  std::string text;
  constexpr Eigen::Index most = 4;
  for (Eigen::Index i = 0; i < std::min(values.size(), most); ++i) {
    text += (i > 0 ? ", " : "") + rounded(values[i], sigmas[i]) + " +- " + number(sigmas[i], 2);
  }
  return text + (values.size() > most ? ", ..." : "");
}

const char* name_of(FitProblem problem) {
  switch (problem) {
    case FitProblem::misfit:
      return "misfit";
    case FitProblem::from_inside:
      return "from_inside";
    case FitProblem::unpredictable:
      return "unpredictable";
    case FitProblem::not_found:
      return "not_found";
    default:
      return "none";
  }
}

std::vector<double> numbers_of(const Eigen::VectorXd& v) { return {v.data(), v.data() + v.size()}; }

nlohmann::ordered_json to_json(const FittedUnknown& fitted) {
  nlohmann::ordered_json entry{{"parameter", fitted.unknown.key}, {"unit", fitted.unknown.unit}};
  entry["nominal"] = fitted.unknown.nominal;
  entry["within"] = fitted.unknown.within;
  entry["told"] = fitted.determined;
  entry["value"] = fitted.value;
  entry["sigma"] = fitted.sigma;
  return entry;
}

}  // namespace

std::string verdict(const IdentifyResult& result) {
  const Identification& fit = result.fit;
  if (!fit.fits()) {
    std::string text = fit.problem == FitProblem::not_found
                           ? std::string("the events fit no such machine")
                           : "the events do not fit: " + number(fit.scatter, 3) + " s are left";
    if (result.accepted) {
      text += drifts(result) ? "; taken as the drift of an effective model"
                             : "; taken as the jitter of an effective model";
    }
    return text;
  }
  std::string text =
      fit.unknowns.empty()
          ? "the events fit the scene as it is"
          : "the events fit, with " + plural(fit.unknowns.size(), "parameter") + " as found";
  if (fit.ambiguous()) text += "; ambiguous: so they do with other values";
  return text;
}

std::string to_text(const IdentifyResult& result) {
  const Identification& fit = result.fit;
  std::string text = result.scene + ": " + verdict(result) + '\n';
  if (!fit.fits()) text += reason(fit) + '\n';
  append_causes(result, text);
  if (fit.problem == FitProblem::not_found) return text;
  text += '\n' + plural(static_cast<std::size_t>(fit.impacts), "impact") +
          " from t = " + number(fit.from, 4) + " to " + number(fit.to, 4);
  if (fit.stretches > 1) text += " in " + std::to_string(fit.stretches) + " stretches";
  if (fit.jitter_told) {
    text += ", jitter " + number(fit.jitter, 3) + " s as told.\n";
  } else if (fit.fits() && fit.scatter < exact * fit.interval) {
    text += ", their times exact: " + number(fit.scatter, 2) + " s are left.\n";
  } else {
    text += ", jitter " + number(fit.scatter, 3) + " s as found.\n";
  }
  if (fit.left_out > 0) {
    text += plural(static_cast<std::size_t>(fit.left_out), "event") +
            " left out: beside sustained contacts, or too near to another.\n";
  }
  if (fit.jitter_told) {
    text += "chi^2 is " + number(fit.chi2, 4) + " for " + std::to_string(fit.freedom) +
            " degrees of freedom; up to " + number(fit.largest_chi2, 4) +
            " the times scatter as their jitter has it.\n";
    if (fit.scatter < 0.5 * fit.jitter) {
      text += "They scatter by " + number(fit.scatter, 2) +
              " s alone, so that the deviations below are larger than they need be.\n";
    }
  }
  if (fit.predicted > 0.0) {
    text += "Fitted to the first four fifths, it expects the impacts of the last within " +
            number(fit.predicted, 2) + " s (before: " + number(fit.predicted_before, 2) + " s).\n";
  }
  append_drift(result, text);
  append_trend(result, text);
  append_events(result, text);
  text += '\n';
  append_table(result, text);
  if (!result.held.empty()) {
    append_row({result.held, "held: the events tell only ratios to it"}, text);
  }
  text += "\nStart at t = " + number(fit.start_t, 6) +
          ": q = " + list(fit.start.q, fit.start_sigma.q) + '\n';
  text += "  u = " + list(fit.start.u, fit.start_sigma.u) + '\n';
  for (const Eigen::VectorXd& other : fit.others) {
    text += "It fits as well with";
    for (Eigen::Index k = 0; k < other.size(); ++k) {
      text += (k > 0 ? ", " : " ") + fit.unknowns[static_cast<std::size_t>(k)].unknown.key + ' ' +
              number(other[k], 6);
    }
    text += '\n';
  }
  return text;
}

void to_json(const IdentifyResult& result, nlohmann::ordered_json& object) {
  using Json = nlohmann::ordered_json;
  const Identification& fit = result.fit;
  object["scene"] = result.scene;
  object["verdict"] = verdict(result);
  object["fits"] = fit.fits();
  object["accepted"] = fit.fits() || result.accepted;
  object["ambiguous"] = fit.ambiguous();
  object["problem"] = name_of(fit.problem);
  if (!fit.fits()) object["reason"] = reason(fit);
  object["impacts"] = fit.impacts;
  object["stretches"] = fit.stretches;
  object["left_out"] = fit.left_out;
  object["from"] = fit.from;
  object["to"] = fit.to;
  object["jitter"] = fit.jitter;
  object["jitter_told"] = fit.jitter_told;
  object["scatter"] = fit.scatter;
  object["chi2"] = fit.chi2;
  object["freedom"] = fit.freedom;
  object["largest_chi2"] = fit.largest_chi2;
  object["predicted"] = fit.predicted;
  object["predicted_before"] = fit.predicted_before;
  object["drift"] = nullptr;
  if (result.drift) {
    const DriftEstimate& drift = *result.drift;
    object["drift"] = {{"found", drift.found()}, {"value", drift.drift}, {"low", drift.low},
                       {"high", drift.high},     {"gain", drift.gain},   {"jitter", drift.jitter}};
  }
  object["restitution_trend"] = nullptr;
  if (result.trend) {
    object["restitution_trend"] = {{"found", result.trend->found()},
                                   {"value", result.trend->trend},
                                   {"sigma", result.trend->sigma},
                                   {"gain", result.trend->gain},
                                   {"chi2_without", result.trend->chi2_without},
                                   {"chi2_with", result.trend->chi2_with}};
  }
  object["held"] = nullptr;
  if (!result.held.empty()) object["held"] = result.held;
  object["parameters"] = Json::array();
  for (const FittedUnknown& fitted : fit.unknowns) {
    Json entry = to_json(fitted);
    entry["hides_in"] = nullptr;
    if (fitted.partner >= 0) {
      entry["hides_in"] = fit.unknowns[static_cast<std::size_t>(fitted.partner)].unknown.key;
      entry["correlation"] = fitted.correlation;
    }
    object["parameters"].push_back(std::move(entry));
  }
  object["start"] = {{"t", fit.start_t},
                     {"q", numbers_of(fit.start.q)},
                     {"u", numbers_of(fit.start.u)},
                     {"sigma_q", numbers_of(fit.start_sigma.q)},
                     {"sigma_u", numbers_of(fit.start_sigma.u)}};
  object["spurious"] = Json::array();
  for (const std::size_t i : fit.spurious) {
    object["spurious"].push_back(
        {{"t", result.events[i].t}, {"contact", result.events[i].contact + 1}});
  }
  object["missing"] = Json::array();
  for (const MissingImpact& missing : fit.missing) {
    object["missing"].push_back({{"t", missing.t}, {"contact", missing.contact + 1}});
  }
  object["others"] = Json::array();
  for (const Eigen::VectorXd& other : fit.others) object["others"].push_back(numbers_of(other));
  if (!result.asked_for_causes) return;
  object["simplest"] = Json::array();
  for (const Explanation& cause : result.causes.simplest) {
    Json entry = Json::array();
    for (const FittedUnknown& fitted : cause.fit.unknowns) entry.push_back(to_json(fitted));
    object["simplest"].push_back(std::move(entry));
  }
}

}  // namespace sprag
