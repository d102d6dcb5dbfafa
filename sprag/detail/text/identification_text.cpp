#include "sprag/detail/text/identification_text.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/text/printable.h"
#include "sprag/detail/text/table.h"

namespace sprag {
namespace {

constexpr double hides = 0.8;   // correlations above this are reported
constexpr double exact = 1e-8;  // of the usual time between impacts: below it there is no jitter

std::string change_of(const FittedUnknown& fitted) {
  const double change = fitted.value - fitted.unknown.nominal;
  if (!fitted.unknown.relative) return short_number(change, 3);
  if (fitted.unknown.key == "clock.rate") {
    return short_number(1e6 * change / fitted.unknown.nominal, 4) + " ppm";
  }
  return short_number(100.0 * change / std::abs(fitted.unknown.nominal), 3) + " %";
}

std::string note_of(const IdentifyResult& result, const FittedUnknown& fitted) {
  if (!fitted.determined || fitted.partner < 0 || std::abs(fitted.correlation) < hides) return "";
  return short_number(fitted.correlation, 2) + " with " +
         result.fit.unknowns[static_cast<std::size_t>(fitted.partner)].unknown.key;
}

// "0.65007 +- 6e-05", or at a physical bound "0, below 0.04 (95 %)".
std::string value_of(const FittedUnknown& fitted) {
  if (!fitted.determined) return "not determined";
  if (!fitted.at_bound) {
    return rounded_to_sigma(fitted.value, fitted.sigma) + " +- " + short_number(fitted.sigma, 2);
  }
  const bool below = fitted.high - fitted.value > fitted.value - fitted.low;
  return short_number(fitted.value, 6) + (below ? ", below " : ", above ") +
         short_number(below ? fitted.high : fitted.low, 2) + " (95 %)";
}

constexpr std::array<std::size_t, 4> widths{25, 12, 24, 11};

void append_table(const IdentifyResult& result, std::string& text) {
  append_row(text, widths, {"parameter", "nominal", "fitted", "change", "correlation"});
  for (const FittedUnknown& fitted : result.fit.unknowns) {
    append_row(text, widths,
               {fitted.unknown.key, short_number(fitted.unknown.nominal, 6), value_of(fitted),
                fitted.determined ? change_of(fitted) : "", note_of(result, fitted)});
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
                        " instead of " + short_number(fitted.unknown.nominal, 6);
    if (fitted.unknown.key == "clock.rate") {
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

std::string drift_text(const DriftEstimate& drift) {
  return "The machine drifts from its model: drift " + short_number(drift.drift, 2) + " (" +
         short_number(drift.low, 2) + " to " + short_number(drift.high, 2) +
         "), jitter beside it " + short_number(drift.jitter, 3) + " s.";
}

void append_model_error(const IdentifyResult& result, std::string& text) {
  const Departure& error = result.fit.departure;
  if (result.fit.record_errors.explains(result.fit.scatter)) {
    text += "The recorded input explains the scatter; a drift of the machine is not visible.\n";
  } else if (error.is_drift()) {
    text += drift_text(*error.drift) + " The deviations below include it.\n";
  } else if (error.is_scatter()) {
    text += "The restitution scatters from impact to impact by " +
            short_number(error.scatter->scatter, 2) + ", jitter beside it " +
            short_number(error.scatter->jitter, 3) + " s. The deviations below include it.\n";
    const double than_drift = error.scatter->gain - (error.drift ? error.drift->gain : 0.0);
    if (std::abs(than_drift) < significant_departure)
      text += "A drift explains the events about as well. " + drift_text(*error.drift) + '\n';
  } else if (error.drift && error.drift->high > 0.0) {
    text += "No drift from the model is found; it is below " + short_number(error.drift->high, 2) +
            " (95 %).\n";
  }
  // Without a deviation the trend is one of the fitted parameters.
  if (!error.trend || !(error.trend->sigma > 0.0)) return;
  const RestitutionTrend& trend = *error.trend;
  if (!trend.found()) {
    text += "No dependence of the restitution on the impact's speed is found: " +
            rounded_to_sigma(trend.trend, trend.sigma) + " +- " + short_number(trend.sigma, 2) +
            " per unit of speed.\n";
    return;
  }
  text += std::string("Restitution ") + (trend.trend < 0.0 ? "falls" : "rises") + " by " +
          rounded_to_sigma(std::abs(trend.trend), trend.sigma) + " +- " +
          short_number(trend.sigma, 2) + " per unit of the impact's speed: chi^2 falls from " +
          short_number(trend.chi2_without, 4) + " to " + short_number(trend.chi2_with, 4) + ".\n";
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
            short_number(errors.other_scatter, 2) + " s only, instead of " +
            short_number(result.fit.scatter, 2) + " s.\n";
  }
}

void append_events(const IdentifyResult& result, std::string& text) {
  for (const std::size_t i : result.fit.spurious) {
    const ContactEvent& event = result.events[i];
    text += "Spurious: t = " + short_number(event.t, 8) + ", contact " +
            std::to_string(event.contact + 1) + ".\n";
  }
  for (const MissingImpact& missing : result.fit.missing) {
    text += "Missing: an impact of contact " + std::to_string(missing.contact + 1) +
            " near t = " + short_number(missing.t, 6) + ".\n";
  }
}

std::string list(const Eigen::VectorXd& values, const Eigen::VectorXd& sigmas) {
  std::string text;
  constexpr Eigen::Index most = 4;
  for (Eigen::Index i = 0; i < std::min(values.size(), most); ++i) {
    text += (i > 0 ? ", " : "") + rounded_to_sigma(values[i], sigmas[i]) + " +- " +
            short_number(sigmas[i], 2);
  }
  return text + (values.size() > most ? ", ..." : "");
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
          " from t = " + short_number(fit.from, 4) + " to " + short_number(fit.to, 4);
  if (fit.stretches > 1) text += " in " + std::to_string(fit.stretches) + " stretches";
  if (fit.jitter_given) {
    text += ", jitter " + short_number(fit.jitter, 3) + " s as specified, scatter " +
            short_number(fit.scatter, 3) + " s as found.\n";
  } else if (fit.fits() && fit.scatter < exact * fit.interval) {
    text += ", exact times (scatter " + short_number(fit.scatter, 2) + " s).\n";
  } else {
    text +=
        (fit.fits() ? ", jitter " : ", scatter ") + short_number(fit.scatter, 3) + " s as found.\n";
  }
  if (fit.left_out > fit.spurious_left_out && fit.problem != FitProblem::events_left_out) {
    text += plural(static_cast<std::size_t>(fit.left_out - fit.spurious_left_out), "event") +
            " not used: in parts too short to count, cut by near impacts or sustained contacts.\n";
  }
  if (fit.jitter_given) {
    text += "chi^2 is " + short_number(fit.chi2, 4) + " for " + std::to_string(fit.freedom) +
            " degrees of freedom; the limit is " + short_number(fit.largest_chi2, 4) + ".\n";
    if (fit.fits() && fit.scatter < 0.5 * fit.jitter) {
      text += "The times scatter by " + short_number(fit.scatter, 2) +
              " s only: with a smaller --jitter the deviations below would be smaller.\n";
    }
  }
  if (fit.predicted > 0.0) {
    text += "The fit to the first four fifths predicts the impacts of the last fifth within " +
            short_number(fit.predicted, 2) +
            " s (within the four: " + short_number(fit.predicted_before, 2) + " s).\n";
  }
  append_model_error(result, text);
  append_record_errors(result, text);
  append_events(result, text);
  text += '\n';
  append_table(result, text);
  if (!result.held.empty()) {
    append_row(text, widths, {result.held, "held: the events determine only ratios to it"});
  }
  if (!fit.ambiguities.empty()) text += '\n';
  for (const ClockAmbiguity& ambiguity : fit.ambiguities) text += to_text(ambiguity) + '\n';
  if (!fit.fits() && !result.accepted) return text;
  text += "\nStart at t = " + short_number(fit.start_t, 6) +
          ": q = " + list(fit.start.q, fit.start_sigma.q) + '\n';
  text += "  u = " + list(fit.start.u, fit.start_sigma.u) + '\n';
  return text;
}

}  // namespace sprag
