#include "tools/identify/print.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "command_line/printable.h"
#include "sprag/detail/identification/verdict.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double hides = 0.8;   // correlations above this are reported
constexpr double exact = 1e-8;  // of the usual time between impacts: below it there is no jitter

std::string number(double value, int digits) { return short_number(value, digits); }

std::string change_of(const FittedUnknown& fitted) {
  const double change = fitted.value - fitted.unknown.nominal;
  const bool absolute = fitted.unknown.kind == Kind::phase || fitted.unknown.kind == Kind::delay ||
                        fitted.unknown.kind == Kind::clock_offset;
  if (fitted.unknown.nominal == 0.0 || absolute) return number(change, 3);
  if (fitted.unknown.kind == Kind::clock_rate) {
    return number(1e6 * change / fitted.unknown.nominal, 4) + " ppm";
  }
  return number(100.0 * change / std::abs(fitted.unknown.nominal), 3) + " %";
}

std::string note_of(const IdentifyResult& result, const FittedUnknown& fitted) {
  if (!fitted.determined || fitted.partner < 0 || std::abs(fitted.correlation) < hides) return "";
  return number(fitted.correlation, 2) + " with " +
         result.fit.unknowns[static_cast<std::size_t>(fitted.partner)].unknown.key;
}

// "0.65007 +- 6e-05", or at a physical bound "0, below 0.04 (95 %)".
std::string value_of(const FittedUnknown& fitted) {
  if (!fitted.determined) return "not determined";
  if (!fitted.at_bound) {
    return rounded_to_sigma(fitted.value, fitted.sigma) + " +- " + number(fitted.sigma, 2);
  }
  const bool below = fitted.high - fitted.value > fitted.value - fitted.low;
  return number(fitted.value, 6) + (below ? ", below " : ", above ") +
         number(below ? fitted.high : fitted.low, 2) + " (95 %)";
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
  append_row({"parameter", "nominal", "fitted", "change", "correlation"}, text);
  for (const FittedUnknown& fitted : result.fit.unknowns) {
    append_row({fitted.unknown.key, number(fitted.unknown.nominal, 6), value_of(fitted),
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
    std::string value = fitted.unknown.key + ' ' + rounded_to_sigma(fitted.value, fitted.sigma) +
                        " instead of " + number(fitted.unknown.nominal, 6);
    if (fitted.unknown.kind == Kind::clock_rate) {
      value = "a contact clock that is " + pace_of_clock(fitted.value) + " (" + value + ')';
    }
    text += value;
  }
  return text;
}

void append_causes(const IdentifyResult& result, std::string& text) {
  if (!result.asked_for_causes) return;
  const auto& simplest = result.causes.simplest;
  if (simplest.empty()) {
    text += "No single parameter and no pair of them explains the events.\n";
    return;
  }
  if (simplest.front().keys.empty()) {
    text += "The scene as it is explains the events, except for the start.\n";
    return;
  }
  std::string first = instead(simplest.front());
  if (first.starts_with("a contact clock")) first.front() = 'A';
  text += first + (simplest.front().keys.size() > 1 ? " alone explain" : " alone explains") +
          " the events.\n";
  constexpr std::size_t most = 4;
  for (std::size_t i = 1; i < std::min(simplest.size(), most); ++i) {
    text += "  " + instead(simplest[i]) + " as well\n";
  }
}

void append_model_error(const IdentifyResult& result, std::string& text) {
  const Departure& error = result.fit.departure;
  if (result.fit.record_errors.explains(result.fit.scatter)) {
    text += "The recorded input explains the scatter; a drift of the machine is not visible.\n";
  } else if (error.is_drift()) {
    const DriftEstimate& drift = *error.drift;
    text += "The machine drifts from its model: drift " + number(drift.drift, 2) + " (" +
            number(drift.low, 2) + " to " + number(drift.high, 2) + "), jitter beside it " +
            number(drift.jitter, 3) + " s. The deviations below include it.\n";
  } else if (error.is_scatter()) {
    text += "The restitution scatters from impact to impact by " +
            number(error.scatter->scatter, 2) + ", jitter beside it " +
            number(error.scatter->jitter, 3) + " s. The deviations below include it.\n";
  } else if (error.drift && error.drift->high > 0.0) {
    text += "No drift from the model is found; it is below " + number(error.drift->high, 2) +
            " (95 %).\n";
  }
  if (!error.trend_beside) return;
  const RestitutionTrend& trend = *error.trend_beside;
  if (!trend.found()) {
    text += "No dependence of the restitution on the impact's speed is found: " +
            rounded_to_sigma(trend.trend, trend.sigma) + " +- " + number(trend.sigma, 2) +
            " per unit of speed.\n";
    return;
  }
  text += std::string("Restitution ") + (trend.trend < 0.0 ? "falls" : "rises") + " by " +
          rounded_to_sigma(std::abs(trend.trend), trend.sigma) + " +- " + number(trend.sigma, 2) +
          " per unit of the impact's speed: chi^2 falls from " + number(trend.chi2_without, 4) +
          " to " + number(trend.chi2_with, 4) + ".\n";
}

// Where the recorded inputs limit the accuracy.
void append_record_errors(const IdentifyResult& result, std::string& text) {
  const RecordErrors& errors = result.fit.record_errors;
  if (errors.empty()) return;
  std::string keys;
  for (const FittedUnknown& fitted : result.fit.unknowns) {
    if (!fitted.is_limited_by_record()) continue;
    keys += (keys.empty() ? "" : ", ") + fitted.unknown.key;
  }
  if (keys.empty()) {
    text += "Noise and interpolation of the recorded input add little to the deviations below.\n";
  } else {
    text += "The recorded input limits " + keys +
            ": about half of the variance below or more is by its noise and its interpolation. " +
            (errors.noise_scatter > errors.resolution_scatter ? "Use a better sensor.\n"
                                                              : "Sample faster.\n");
  }
  if (errors.other_scatter > 0.0) {
    text += "With the other `interpolation` the times scatter by " +
            number(errors.other_scatter, 2) + " s only, instead of " +
            number(result.fit.scatter, 2) + " s.\n";
  }
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
    text += (i > 0 ? ", " : "") + rounded_to_sigma(values[i], sigmas[i]) + " +- " +
            number(sigmas[i], 2);
  }
  return text + (values.size() > most ? ", ..." : "");
}

std::vector<double> numbers_of(const Eigen::VectorXd& v) { return {v.data(), v.data() + v.size()}; }

// The value at an end, -1 or 1, of the range within which the parameter is assumed. For a phase, an
// offset or a clearance, which are not limited, it only is a scale.
double of_range(const Unknown& unknown, int end) {
  const double share = end < 0 ? -std::min(unknown.within, 0.9) : unknown.within;
  return unknown.value(unknown.logarithmic ? std::log1p(share) : share);
}

nlohmann::ordered_json to_json(const FittedUnknown& fitted) {
  nlohmann::ordered_json entry{{"parameter", fitted.unknown.key}, {"unit", fitted.unknown.unit}};
  entry["nominal"] = fitted.unknown.nominal;
  entry["within"] = fitted.unknown.within;
  entry["range"] = {of_range(fitted.unknown, -1), of_range(fitted.unknown, 1)};
  entry["told"] = fitted.determined;
  entry["determined"] = fitted.determined;
  entry["value"] = nullptr;
  entry["sigma"] = nullptr;
  entry["low"] = nullptr;
  entry["high"] = nullptr;
  if (!fitted.determined) return entry;
  entry["value"] = fitted.value;
  if (!fitted.at_bound) entry["sigma"] = fitted.sigma;
  entry["low"] = fitted.low;
  entry["high"] = fitted.high;
  entry["at_bound"] = fitted.at_bound;
  entry["sigma_by_record"] = fitted.of_record;
  return entry;
}

// Correlations of the parameters, in their order; null where one of the two is not determined or
// at a bound.
nlohmann::ordered_json correlations_of(const Identification& fit) {
  const Eigen::MatrixXd& covariance = fit.likelihood.covariance;
  const auto n = std::min(std::ssize(fit.unknowns), covariance.rows());
  const auto variance = [&](Eigen::Index k) {
    return fit.unknowns[static_cast<std::size_t>(k)].determined ? covariance(k, k) : 0.0;
  };
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (Eigen::Index i = 0; i < n; ++i) {
    nlohmann::ordered_json row = nlohmann::ordered_json::array();
    for (Eigen::Index j = 0; j < n; ++j) {
      const double scale = std::sqrt(variance(i) * variance(j));
      if (!(scale > 0.0)) {
        row.push_back(nullptr);
        continue;
      }
      const double of_pair = 0.5 * (covariance(i, j) + covariance(j, i)) / scale;
      row.push_back(i == j ? 1.0 : std::clamp(of_pair, -1.0, 1.0));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// Measured minus fitted time of each impact that is used, and the standard deviation that the
// jitter gives this difference; null where the fit follows the time exactly.
nlohmann::ordered_json residuals_of(const Identification& fit) {
  using Json = nlohmann::ordered_json;
  Json t = Json::array(), contact = Json::array(), residual = Json::array(),
       deviation = Json::array();
  const Likelihood& solution = fit.likelihood;
  const std::size_t stretches = std::min(fit.measured.size(), solution.path.size());
  for (std::size_t s = 0; s < stretches; ++s) {
    const std::vector<Impact>& measured = fit.measured[s].impacts;
    const std::vector<Impact>& path = solution.path[s].impacts;
    for (std::size_t k = 0; k < std::min(measured.size(), path.size()); ++k) {
      if (!measured[k].timed) continue;
      t.push_back(measured[k].t);
      contact.push_back(measured[k].contact + 1);
      residual.push_back(measured[k].t - path[k].t);
      const bool known = s < solution.leverage.size() &&
                         static_cast<Eigen::Index>(k) < solution.leverage[s].size();
      const double left = known ? 1.0 - solution.leverage[s][static_cast<Eigen::Index>(k)] : 0.0;
      const double sigma = left > 0.0 ? fit.jitter * std::sqrt(left) : 0.0;
      deviation.push_back(sigma > 0.0 ? Json(sigma) : Json(nullptr));
    }
  }
  return {{"t", t}, {"contact", contact}, {"residual", residual}, {"sigma", deviation}};
}

nlohmann::ordered_json to_json(const std::vector<ClockAmbiguity>& ambiguities) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const ClockAmbiguity& ambiguity : ambiguities) {
    array.push_back(
        {{"parameter", ambiguity.key}, {"equals", ambiguity.equals}, {"text", to_text(ambiguity)}});
  }
  return array;
}

nlohmann::ordered_json to_json(const std::vector<Explanation>& causes) {
  nlohmann::ordered_json array = nlohmann::ordered_json::array();
  for (const Explanation& cause : causes) {
    nlohmann::ordered_json entry = nlohmann::ordered_json::array();
    for (const FittedUnknown& fitted : cause.fit.unknowns) entry.push_back(to_json(fitted));
    array.push_back(std::move(entry));
  }
  return array;
}

void add_repairs(const IdentifyResult& result, nlohmann::ordered_json& object) {
  object["spurious"] = nlohmann::ordered_json::array();
  for (const std::size_t i : result.fit.spurious) {
    object["spurious"].push_back(
        {{"t", result.events[i].t}, {"contact", result.events[i].contact + 1}});
  }
  object["missing"] = nlohmann::ordered_json::array();
  for (const MissingImpact& missing : result.fit.missing) {
    object["missing"].push_back({{"t", missing.t}, {"contact", missing.contact + 1}});
  }
}

void write_departure(const Departure& error, nlohmann::ordered_json& object) {
  object["drift"] = nullptr;
  if (error.drift) {
    const DriftEstimate& drift = *error.drift;
    object["drift"] = {{"found", drift.found()}, {"value", drift.drift}, {"low", drift.low},
                       {"high", drift.high},     {"gain", drift.gain},   {"jitter", drift.jitter}};
  }
  object["restitution_scatter"] = nullptr;
  if (error.scatter) {
    object["restitution_scatter"] = {{"found", error.scatter->found()},
                                     {"value", error.scatter->scatter},
                                     {"gain", error.scatter->gain},
                                     {"jitter", error.scatter->jitter}};
  }
  object["restitution_trend"] = nullptr;
  if (const auto& trend = error.trend_beside) {
    object["restitution_trend"] = {{"found", trend->found()},
                                   {"value", trend->trend},
                                   {"sigma", trend->sigma},
                                   {"gain", trend->gain},
                                   {"chi2_without", trend->chi2_without},
                                   {"chi2_with", trend->chi2_with}};
  }
}

void write_record_errors(const Identification& fit, nlohmann::ordered_json& object) {
  object["record"] = nullptr;
  if (const RecordErrors& errors = fit.record_errors; !errors.empty()) {
    const bool limits =
        std::any_of(fit.unknowns.begin(), fit.unknowns.end(),
                    [](const FittedUnknown& fitted) { return fitted.is_limited_by_record(); });
    object["record"] = {{"limits", limits},
                        {"noise_scatter", errors.noise_scatter},
                        {"resolution_scatter", errors.resolution_scatter},
                        {"other_interpolation_scatter", nullptr}};
    if (errors.other_scatter > 0.0) {
      object["record"]["other_interpolation_scatter"] = errors.other_scatter;
    }
  }
}

}  // namespace

std::string verdict(const IdentifyResult& result) {
  std::string text = verdict_of(result.fit);
  if (result.accepted) {
    text += drifts(result) ? "; taken as an effective model with a drift"
                           : "; taken as an effective model, the scatter as its jitter";
  }
  return text;
}

std::string to_text(const IdentifyResult& result) {
  const Identification& fit = result.fit;
  std::string text = printable(result.scene) + ": " + verdict(result) + '\n';
  if (!fit.fits()) text += reason_of(fit) + '\n';
  append_causes(result, text);
  if (!fit.converged()) return text;
  text += '\n' + plural(static_cast<std::size_t>(fit.impacts), "impact") +
          " from t = " + number(fit.from, 4) + " to " + number(fit.to, 4);
  if (fit.stretches > 1) text += " in " + std::to_string(fit.stretches) + " stretches";
  if (fit.jitter_given) {
    text += ", jitter " + number(fit.jitter, 3) + " s as specified, scatter " +
            number(fit.scatter, 3) + " s as found.\n";
  } else if (fit.fits() && fit.scatter < exact * fit.interval) {
    text += ", exact times (scatter " + number(fit.scatter, 2) + " s).\n";
  } else {
    text += (fit.fits() ? ", jitter " : ", scatter ") + number(fit.scatter, 3) + " s as found.\n";
  }
  if (fit.left_out > fit.spurious_left_out && fit.problem != FitProblem::events_left_out) {
    text += plural(static_cast<std::size_t>(fit.left_out - fit.spurious_left_out), "event") +
            " not used: in parts too short to count, cut by near impacts or sustained contacts.\n";
  }
  if (fit.jitter_given) {
    text += "chi^2 is " + number(fit.chi2, 4) + " for " + std::to_string(fit.freedom) +
            " degrees of freedom; the limit is " + number(fit.largest_chi2, 4) + ".\n";
    if (fit.fits() && fit.scatter < 0.5 * fit.jitter) {
      text += "The times scatter by " + number(fit.scatter, 2) +
              " s only: with a smaller --jitter the deviations below would be smaller.\n";
    }
  }
  if (fit.predicted > 0.0) {
    text += "The fit to the first four fifths predicts the impacts of the last fifth within " +
            number(fit.predicted, 2) + " s (within the four: " + number(fit.predicted_before, 2) +
            " s).\n";
  }
  append_model_error(result, text);
  append_record_errors(result, text);
  append_events(result, text);
  text += '\n';
  append_table(result, text);
  if (!result.held.empty()) {
    append_row({result.held, "held: the events determine only ratios to it"}, text);
  }
  if (!fit.ambiguities.empty()) text += '\n';
  for (const ClockAmbiguity& ambiguity : fit.ambiguities) text += to_text(ambiguity) + '\n';
  if (!fit.fits() && !result.accepted) return text;
  text += "\nStart at t = " + number(fit.start_t, 6) +
          ": q = " + list(fit.start.q, fit.start_sigma.q) + '\n';
  text += "  u = " + list(fit.start.u, fit.start_sigma.u) + '\n';
  return text;
}

void write_json(const IdentifyResult& result, nlohmann::ordered_json& object) {
  using Json = nlohmann::ordered_json;
  const Identification& fit = result.fit;
  object["scene"] = result.scene;
  object["verdict"] = verdict(result);
  object["fits"] = fit.fits();
  object["accepted"] = fit.fits() || result.accepted;
  object["ambiguous"] = fit.ambiguous();
  object["problem"] = name_of(fit.problem);
  if (!fit.fits()) object["reason"] = reason_of(fit);
  object["impacts"] = fit.impacts;
  object["stretches"] = fit.stretches;
  object["events"] = fit.events;
  object["left_out"] = fit.left_out;
  object["used_share"] = fit.used_share();
  object["from"] = fit.from;
  object["to"] = fit.to;
  // A fit that has not converged reports no numbers.
  const auto found = [&](double value) { return fit.converged() ? Json(value) : Json(nullptr); };
  object["jitter"] = found(fit.jitter);
  object["jitter_told"] = fit.jitter_given;
  object["scatter"] = found(fit.scatter);
  object["chi2"] = found(fit.chi2);
  object["freedom"] = fit.freedom;
  object["largest_chi2"] = fit.largest_chi2;
  object["predicted"] = found(fit.predicted);
  object["predicted_before"] = found(fit.predicted_before);
  write_departure(fit.departure, object);
  write_record_errors(fit, object);
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
  object["correlations"] = nullptr;
  object["residuals"] = nullptr;
  if (fit.converged()) {
    object["correlations"] = correlations_of(fit);
    object["residuals"] = residuals_of(fit);
  }
  object["clock_ambiguities"] = to_json(fit.ambiguities);
  object["start"] = nullptr;
  if (fit.fits() || result.accepted)
    object["start"] = {{"t", fit.start_t},
                       {"q", numbers_of(fit.start.q)},
                       {"u", numbers_of(fit.start.u)},
                       {"sigma_q", numbers_of(fit.start_sigma.q)},
                       {"sigma_u", numbers_of(fit.start_sigma.u)}};
  add_repairs(result, object);
  object["others"] = Json::array();
  for (const Eigen::VectorXd& other : fit.others) object["others"].push_back(numbers_of(other));
  if (!result.asked_for_causes) return;
  object["simplest"] = to_json(result.causes.simplest);
}

}  // namespace sprag
