#include "sprag/detail/identification/explanations.h"

#include <algorithm>

#include "sprag/detail/identification/repaired_events.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

// Whether a change of the clock may appear as a change of the parameter.
bool follows_clock(const Parameter& unknown, const Parameter& of_clock) {
  const std::string_view of = quantity(unknown.key);
  if (of_clock.key == "clock.offset") return of == "phase";
  // A fit without the clock may take the shift of the first impacts as a phase, and scale F / r^2.
  return is_of_flow(unknown) || of == "frequency" || of == "phase" || carries_scale(unknown);
}

// Wald's test: whether the parameters that are not sought are far from nominal, by their
// covariance.
bool contradicts(const Identification& fit, const std::vector<Parameter>& all,
                 const std::vector<std::size_t>& sought) {
  constexpr double contradiction = 1e4;  // of chi^2; far beyond the error of the linearization
  std::vector<Eigen::Index> others;
  for (std::size_t k = 0; k < fit.unknowns.size(); ++k) {
    const FittedUnknown& fitted = fit.unknowns[k];
    // A free scale changes amplitudes, constant forces and clearances together.
    const bool has_scale =
        carries_scale(fitted.unknown) || quantity(fitted.unknown.key) == "clearance";
    const bool is_sought = std::any_of(sought.begin(), sought.end(), [&](std::size_t j) {
      return all[j].key == fitted.unknown.key || (carries_scale(all[j]) && has_scale) ||
             (is_of_clock(all[j]) && follows_clock(fitted.unknown, all[j]));
    });
    const auto i = static_cast<Eigen::Index>(k);
    const bool known = fitted.determined && fit.covariance(i, i) > 0.0;
    if (!is_sought && known) others.push_back(i);
  }
  if (others.empty()) return false;
  Eigen::VectorXd off(static_cast<Eigen::Index>(others.size()));
  for (std::size_t j = 0; j < others.size(); ++j) {
    const FittedUnknown& fitted = fit.unknowns[static_cast<std::size_t>(others[j])];
    off[static_cast<Eigen::Index>(j)] = fitted.unknown.coordinate(fitted.value);
  }
  const CholeskyFactor covariance(fit.covariance(others, others));
  return covariance.exists() && covariance.solve_L(off).squaredNorm() > contradiction;
}

// The events as the fit used them. Lost ones have the times of the fit and are listed in `guessed`.
std::vector<ContactEvent> used_events(std::span<const ContactEvent> events,
                                      const Identification& fit,
                                      std::vector<std::size_t>& guessed) {
  std::vector<ContactEvent> used;
  for (const RepairedEvent& repaired : repaired_events(events, fit)) {
    if (repaired.spurious) continue;
    if (!repaired.number) guessed.push_back(used.size());
    used.push_back(repaired.event);
  }
  return used;
}

}  // namespace

Explanations explain(const Scene& scene, std::span<const ContactEvent> events,
                     const IdentificationSettings& settings, double jitter,
                     const Identification& all_fitted) {
  Explanations explanations;
  IdentificationSettings of = settings;
  of.jitter = jitter;
  of.mend = false;
  of.retry = false;
  const std::vector<ContactEvent> used = used_events(events, all_fitted, of.guessed);
  const std::vector<Parameter>& all = settings.unknowns;
  const auto judge = [&](const std::vector<std::size_t>& sought) {
    if (contradicts(all_fitted, all, sought)) return;
    of.unknowns.clear();
    Explanation explanation;
    for (const std::size_t k : sought) {
      of.unknowns.push_back(all[k]);
      explanation.keys.push_back(all[k].key);
    }
    try {
      explanation.fit = identify(scene, used, of);
    } catch (const TooFewImpacts&) {
      return;
    }
    const auto& unknowns = explanation.fit.unknowns;
    const bool determined =
        std::all_of(unknowns.begin(), unknowns.end(),
                    [](const FittedUnknown& fitted) { return fitted.determined; });
    if (explanation.fit.fits() && determined) {
      explanations.simplest.push_back(std::move(explanation));
    }
  };
  const auto& unknowns = all_fitted.unknowns;
  const bool as_it_is = std::none_of(unknowns.begin(), unknowns.end(),
                                     [](const FittedUnknown& fitted) { return fitted.determined; });
  if (as_it_is && all_fitted.fits()) {
    // A fit without a determined unknown has the values of the scene.
    Explanation explanation{.keys = {}, .fit = all_fitted};
    explanation.fit.unknowns.clear();
    explanations.simplest.push_back(std::move(explanation));
    return explanations;
  }
  judge({});
  if (explanations.simplest.empty()) {
    for (std::size_t j = 0; j < all.size(); ++j) judge({j});
  }
  if (explanations.simplest.empty()) {
    for (std::size_t j = 0; j < all.size(); ++j) {
      for (std::size_t k = j + 1; k < all.size(); ++k) judge({j, k});
    }
  }
  std::stable_sort(
      explanations.simplest.begin(), explanations.simplest.end(),
      [](const Explanation& a, const Explanation& b) { return a.fit.chi2 < b.fit.chi2; });
  return explanations;
}

}  // namespace sprag
