#include "sprag/detail/identification/task.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/filter/triangularize.h"
#include "sprag/detail/identification/fit.h"
#include "sprag/detail/identification/path_posterior.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/identification.h"

namespace sprag {
namespace {

// Least resolution of times, relative to the usual time between impacts.
constexpr double resolved_time = 1e-10;

// Process noise of the events of a task: the walks of [adapt] and the noise of the records.
FilterModel noise_of(const SceneValues& family) {
  const Scene& scene = family.nominal();
  FilterModel model{.walk = walk_of(scene, std::ssize(family.unknowns()))};
  if (family.records().empty()) return model;
  const Eigen::MatrixXd noise = uncertainty_of(scene).input_noise;
  const FamilyFlight flight(scene, {});
  model.kicks = product(flight.from_state().rightCols(flight.n()), noise);
  return model;
}

// Adds errors of the unknowns, which are independent of the belief's.
void add_errors(const Eigen::VectorXd& of_unknowns, FilterBelief& belief) {
  const Eigen::Index P = of_unknowns.size(), size = belief.S.rows();
  FilterBelief::Rows all = FilterBelief::Rows::Zero(size, size + P);
  all.leftCols(size) = belief.S;
  all.bottomRightCorner(P, P) = of_unknowns.asDiagonal();
  Eigen::VectorXd scratch(all.cols());
  triangularize(all, 0, size, all.cols(), scratch);
  belief.S = all.leftCols(size);
}

}  // namespace

std::vector<Parameter> unknowns_to_adapt(const Scene& scene) {
  const std::vector<std::string>& free = scene.prior.adaptation.free;
  std::vector<Parameter> unknowns =
      free.empty() ? all_but_the_scale(scene) : parameters_named(scene, free);
  const Eigen::VectorXd& within = scene.prior.adaptation.within;
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    unknowns[k].within = within[within.size() > 1 ? static_cast<Eigen::Index>(k) : 0];
  }
  return unknowns;
}

Eigen::VectorXd walk_of(const Scene& scene, Eigen::Index unknowns) {
  const Eigen::VectorXd& walk = scene.prior.adaptation.walk;
  return walk.size() > 1 ? walk : Eigen::VectorXd::Constant(unknowns, walk[0]);
}

AdaptationResult run(const AdaptationTask& task, const SceneValues& family) {
  AdaptationResult result;
  result.task = task;
  const Scene& scene = family.nominal();
  IdentificationSettings settings;
  settings.unknowns = family.unknowns();
  settings.begins = task.begins;
  settings.closed = task.closed;
  // Parameters that walk scatter the event times beyond the jitter.
  if (scene.prior.jitter > 0.0 && !scene.prior.adaptation.walks())
    settings.jitter = scene.prior.jitter;
  settings.white = !scene.prior.adaptation.walks();
  settings.strictly_within = false;  // parameters may have moved since the scene was written
  EventIdentification identified;
  try {
    identified = fit_events(scene, task.events, settings);
  } catch (const TooFewImpacts&) {
    return result;
  }
  const Identification& found = identified.result;
  // A filter that starts from undetermined values would be overconfident.
  const bool determined =
      std::all_of(found.unknowns.begin(), found.unknowns.end(),
                  [](const FittedUnknown& fitted) { return fitted.determined; });
  result.accepted = found.fits() && !found.ambiguous() && determined;
  if (!result.accepted) return result;
  const double sigma = scene.prior.jitter > 0.0 ? scene.prior.jitter
                       : scene.prior.adaptation.walks()
                           ? resolved_time * found.interval
                           : std::max(found.jitter, resolved_time * found.interval);
  const EventFit& fit = identified.fit;
  result.belief = path_posterior(family, noise_of(family), fit, sigma);
  // The path posterior has the noise of the records, but not their interpolation errors.
  if (!found.record_errors.empty()) add_errors(found.record_errors.resolution, result.belief);
  result.accepted = result.belief.z.allFinite() && result.belief.S.allFinite();
  const FitEvent& last = fit.stretches.back().events.back();
  result.state_is_known = last.timed && last.index + 1 == task.events.size() &&
                          last.kind == ContactEventKind::pulse &&
                          fit.stretches.back().held_before(fit.stretches.back().size() - 1) == 0;
  return result;
}

}  // namespace sprag
