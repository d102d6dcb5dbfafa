#include "tools/identify/json.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sprag/detail/identification/fitted_parameters.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/clock_ambiguity.h"

namespace sprag {
namespace {

std::vector<double> numbers_of(const Eigen::VectorXd& v) { return {v.data(), v.data() + v.size()}; }

// The value at an end, -1 or 1, of the range within which the parameter is assumed. For a phase, an
// offset or a clearance, which are not limited, it only is a scale.
double of_range(const Parameter& unknown, int end) {
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

// Correlations of the parameters, in their order; null where there is none.
nlohmann::ordered_json correlations_of(const Identification& fit) {
  const Eigen::MatrixXd all = correlations(fit);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (Eigen::Index i = 0; i < all.rows(); ++i) rows.push_back(numbers_of(all.row(i)));
  return rows;
}

// Measured minus fitted time of each impact that is used, and the standard deviation that the
// jitter gives this difference; null where the fit follows the time exactly.
nlohmann::ordered_json residuals_of(const Identification& fit) {
  using Json = nlohmann::ordered_json;
  Json t = Json::array(), contact = Json::array(), residual = Json::array(),
       deviation = Json::array();
  for (const EventResidual& of : fit.residuals) {
    if (!of.closes) continue;
    t.push_back(of.t);
    contact.push_back(of.contact + 1);
    residual.push_back(of.residual);
    deviation.push_back(of.sigma > 0.0 ? Json(of.sigma) : Json(nullptr));
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
  object["cause"] = name_of(error.cause);
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
  if (const auto& trend = error.trend) {
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
