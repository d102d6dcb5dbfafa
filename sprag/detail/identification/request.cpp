#include "sprag/detail/identification/request.h"

#include <algorithm>
#include <stdexcept>

#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

constexpr double largest_within = 10.0;

bool contains(const std::vector<Parameter>& unknowns, const std::string& key) {
  return std::any_of(unknowns.begin(), unknowns.end(),
                     [&](const Parameter& unknown) { return unknown.key == key; });
}

void check_within(double within) {
  if (within > 0.0 && within <= largest_within) return;
  throw std::invalid_argument("within is " + short_number(within, 6) + "; must be in (0, 10]");
}

// The unknowns that may be wrong alone: the sought ones and the one that is held for its scale.
std::vector<Parameter> single_causes(const Scene& scene, const std::vector<Parameter>& sought) {
  std::vector<Parameter> causes = sought;
  const std::vector<Parameter> all = parameters_of(scene);
  // An amplitude is identifiable only if something else fixes the scale.
  const auto scales = std::count_if(all.begin(), all.end(), carries_scale);
  for (const Parameter& unknown : all) {
    if (!contains(causes, unknown.key) && (!carries_scale(unknown) || scales > 1)) {
      causes.push_back(unknown);
    }
  }
  const bool one_frequency = harmonic_groups(scene).size() < 2;
  for (const Parameter& unknown : clock_parameters(scene)) {
    const bool is_phase = unknown.key == "clock.offset" && one_frequency;
    if (!is_phase && !clock_ambiguity(scene, {}, unknown)) causes.push_back(unknown);
  }
  return causes;
}

}  // namespace

std::vector<Parameter> sought(const Scene& scene, const IdentifyRequest& request) {
  std::vector<Parameter> unknowns;
  if (request.free) {
    for (const std::string& key : *request.free) {
      if (!contains(unknowns, key)) unknowns.push_back(parameter_of(scene, key));
    }
  } else {
    unknowns = all_but_the_scale(scene, request.known);
  }
  for (const std::string& key : request.known) {
    parameter_of(scene, key);
    if (contains(unknowns, key)) throw std::invalid_argument("free and known both name " + key);
  }
  if (request.within) check_within(*request.within);
  for (const auto& [key, within] : request.within_of) {
    parameter_of(scene, key);
    check_within(within);
  }
  for (Parameter& unknown : unknowns) {
    const auto own = request.within_of.find(unknown.key);
    if (own != request.within_of.end()) {
      unknown.within = own->second;
      if (quantity(unknown.key) == "slope") unknown.reach = own->second;
    } else if (request.within && unknown.reach == 0.0) {
      unknown.within = *request.within;
    }
  }
  return unknowns;
}

std::string held_for_scale(const Scene& scene, const std::vector<Parameter>& sought) {
  std::string held;
  for (const Parameter& unknown : parameters_of(scene)) {
    if (!carries_scale(unknown) || contains(sought, unknown.key)) continue;
    if (!held.empty()) return "";  // two are known: the scene gives the scale
    held = unknown.key;
  }
  return held;
}

IdentifyResult identify_requested(const Scene& scene, std::span<const ContactEvent> events,
                                  const IdentifyRequest& request, IdentificationSettings settings) {
  settings.unknowns = sought(scene, request);
  settings.jitter = request.jitter;
  if (!request.jitter && scene.prior.jitter > 0.0) settings.jitter = scene.prior.jitter;
  settings.approximate = request.accept;
  IdentifyResult result;
  result.scene = scene.name;
  result.events.assign(events.begin(), events.end());
  result.held = held_for_scale(scene, settings.unknowns);
  result.fit = identify(scene, events, settings);
  // The causes are judged by the specified jitter, else by the scatter of the full fit.
  if (request.causes && result.fit.fits()) {
    IdentificationSettings of_causes = settings;
    of_causes.unknowns = single_causes(scene, settings.unknowns);
    result.causes = explain(scene, events, of_causes, result.fit.jitter, result.fit);
    result.asked_for_causes = true;
  }
  const FitProblem problem = result.fit.problem;
  result.accepted = request.accept &&
                    (problem == FitProblem::wrong_model || problem == FitProblem::events_left_out ||
                     problem == FitProblem::lost_or_spurious_events);
  return result;
}

}  // namespace sprag
