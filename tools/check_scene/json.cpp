#include "tools/check_scene/json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

nlohmann::ordered_json modes_json(const std::vector<Mode>& modes) {
  auto list = nlohmann::ordered_json::array();
  for (const Mode& mode : modes) {
    nlohmann::ordered_json entry{{"omega", mode.omega}, {"decades", mode.decades}};
    if (mode.contact >= 0) {
      entry["contact"] = mode.contact + 1;
      entry["projection"] = mode.projection;
    }
    entry["seen"] = mode.seen;
    entry["barely_seen"] = mode.barely_seen();
    list.push_back(std::move(entry));
  }
  return list;
}

nlohmann::ordered_json opposing_json(const std::vector<OpposingStops>& opposing) {
  auto list = nlohmann::ordered_json::array();
  for (const OpposingStops& stops : opposing) {
    list.push_back({{"contacts", {stops.i + 1, stops.j + 1}}, {"room", stops.room}});
  }
  return list;
}

nlohmann::ordered_json trial_json(const Trial& trial) {
  nlohmann::ordered_json object{{"planned", trial.planned},
                                {"duration", trial.duration},
                                {"error", trial.error},
                                {"closings", trial.closings},
                                {"closings_per_time", trial.closings_per_time()},
                                {"growth", trial.growth},
                                {"longest_open_last_quarter", trial.longest_open},
                                {"open_share_last_quarter", trial.open_share}};
  object["contacts"] = nlohmann::ordered_json::array();
  for (const ContactUse& use : trial.contacts) {
    object["contacts"].push_back({{"closings", use.closings},
                                  {"sustained_share", use.share},
                                  {"sustained_share_last_quarter", use.last_share}});
  }
  return object;
}

}  // namespace

void write_json(const Assessment& a, nlohmann::ordered_json& object) {
  object["scene"] = a.scene;
  object["verdict"] = a.verdict();
  object["synchronizes"] = a.synchronizes();
  object["headline"] = headline(a);
  object["default_estimator"] = {
      {"estimator", "both"},
      {"follows", a.both_follows()},
      {"provided", a.synchronizes() ? a.conditions() : std::vector<std::string>()}};
  object["coordinates"] = a.coordinates;
  object["smallest_eigenvalue"] = {{"M", a.M.smallest}, {"C", a.C.smallest}, {"K", a.K.smallest}};
  if (a.M.definite()) {
    object["W"] = {{"rank", a.W.rank}, {"condition", a.W.condition}};
    object["W"]["opposing_stops"] = opposing_json(a.opposing);
    object["impact"] = {{"law", a.law == ImpactLaw::newton ? "newton" : "poisson"},
                        {"monotone", a.monotonicity.holds()},
                        {"common_restitution", a.monotonicity.common}};
    if (!a.monotonicity.common) object["impact"]["margin"] = a.monotonicity.margin;
    object["path"] = name(a.path);
    object["slow_root"] = a.slow_root;
    object["decades"] = a.decades;
    object["omega_max"] = a.omega_max;
    object["modes"] = modes_json(a.modes);
    object["trial"] = trial_json(a.trial);
    if (a.filter) {
      object["filter"] = {{"duration", a.filter->duration},
                          {"closings", a.filter->closings},
                          {"left", a.filter->left},
                          {"known_from", a.filter->known_from},
                          {"follows", a.filter->follows()}};
    }
  }
  object["findings"] = nlohmann::ordered_json::array();
  for (const Finding& finding : a.findings) {
    object["findings"].push_back({{"id", finding.id},
                                  {"required", finding.required},
                                  {"holds", finding.holds},
                                  {"what", finding.what},
                                  {"provided", finding.provided},
                                  {"change", finding.change}});
  }
}

void write_parameters(const Scene& scene, nlohmann::ordered_json& object) {
  const ParameterUncertainty& parameters = scene.prior.parameters;
  if (parameters.empty()) return;
  auto list = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const Parameter unknown = parameter_of(scene, parameters.keys[k]);
    list.push_back({{"parameter", unknown.key},
                    {"unit", unknown.unit},
                    {"value", unknown.nominal},
                    {"sigma", parameters.sigma[static_cast<Eigen::Index>(k)]},
                    {"consider", static_cast<bool>(parameters.consider[k])}});
  }
  object["uncertain_parameters"] = std::move(list);
}

void write_guaranteed(const std::optional<GuaranteedWidths>& found,
                      nlohmann::ordered_json& object) {
  if (!found) return;
  const auto or_null = [](double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
  };
  nlohmann::ordered_json& of = object["guaranteed"];
  of["why_none"] = found->why_none.empty() ? nlohmann::ordered_json(nullptr)
                                           : nlohmann::ordered_json(found->why_none);
  of["duration"] = found->duration;
  of["bound"] = or_null(found->why_none.empty() ? found->floor.largest : infinity);
  of["bound_after_gap"] = or_null(found->why_none.empty() ? found->floor.without_events : infinity);
  of["half_widths"] = nlohmann::ordered_json::object();
  for (const auto& [name, width] : found->widths) of["half_widths"][name] = or_null(width);
}

}  // namespace sprag
