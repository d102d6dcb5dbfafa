#include "sprag/detail/text/parameters_text.h"

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/text/table.h"

namespace sprag {

std::string parameters_text(const Scene& scene) {
  const ParameterUncertainty& parameters = scene.prior.parameters;
  if (parameters.empty()) return {};
  std::string words = "uncertain parameters:";
  for (std::size_t k = 0; k < parameters.keys.size(); ++k) {
    const std::string& key = parameters.keys[k];
    words += (k > 0 ? ", " : " ") + key + ' ' + short_number(parameter_of(scene, key).nominal, 6) +
             " +- " + short_number(parameters.sigma[static_cast<Eigen::Index>(k)], 2);
    if (parameters.consider[k]) words += " (considered)";
  }
  std::string text;
  append_wrapped(text, words);
  return text;
}

}  // namespace sprag
