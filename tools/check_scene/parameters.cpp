#include "tools/check_scene/parameters.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "sprag/detail/analysis/wrapped_text.h"
#include "sprag/detail/parameters/unknowns.h"

namespace sprag {
namespace {

std::string short_text(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return text;
}

}  // namespace

std::string parameters_text(const Scene& scene) {
  const ParameterUncertainty& parameters = scene.prior.parameters;
  if (parameters.empty()) return {};
  std::string words = "uncertain parameters:";
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const std::string& key = parameters.keys[k];
    words += (k > 0 ? ", " : " ") + key + ' ' + short_text(unknown_of(scene, key).nominal, 6) +
             " +- " + short_text(parameters.sigma[static_cast<Eigen::Index>(k)], 2);
    if (parameters.consider[k]) words += " (considered)";
  }
  std::string text;
  append_wrapped(text, words);
  return text;
}

void write_parameters(const Scene& scene, nlohmann::ordered_json& object) {
  const ParameterUncertainty& parameters = scene.prior.parameters;
  if (parameters.empty()) return;
  auto list = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const Unknown unknown = unknown_of(scene, parameters.keys[k]);
    list.push_back({{"parameter", unknown.key},
                    {"unit", unknown.unit},
                    {"value", unknown.nominal},
                    {"sigma", parameters.sigma[static_cast<Eigen::Index>(k)]},
                    {"consider", static_cast<bool>(parameters.consider[k])}});
  }
  object["uncertain_parameters"] = std::move(list);
}

}  // namespace sprag
