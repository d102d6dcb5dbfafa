#include "sprag/detail/analysis/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>

#include "sprag/detail/analysis/in_parallel.h"
#include "sprag/detail/identification/search.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/identification.h"

namespace sprag {
namespace {

// In units of the usual time between impacts: residuals that count as exact, and the largest
// reasonable scatter.
constexpr double exact = 1e-9;
constexpr double widest = 0.05;
constexpr int least_more_closings = 8;  // besides those that determine the state
// Gain of J that a correct parameter reaches once in 10000 records.
constexpr double significant_gain = 20.0;
// Gain of J by a second parameter. If the first is the only wrong one, the best of ten others
// reaches it once in 200 records.
constexpr double gain_of_second = 12.0;

int closings_of(std::span<const ContactEvent> events, int at_least) {
  int count = 0;
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    const auto closing = std::count_if(of_one.begin(), of_one.end(), [](const ContactEvent& event) {
      return event.kind != ContactEventKind::opens;
    });
    count += closing >= at_least ? 1 : 0;
  });
  return count;
}

// The parameters that may be wrong alone, with the range to search: up to 30 % off, a frequency 10
// %, a damping 100 %. Several harmonics are taken together. The clock's offset is left out where it
// is a phase, unless it is asked for.
std::vector<Parameter> single_causes(const Scene& scene, const std::vector<std::string>& keys) {
  const std::vector<Parameter> common = common_parameters(scene);
  const bool together = std::any_of(common.begin(), common.end(), is_common);
  const bool is_phase = only_frequency(scene.model) > 0.0;
  std::vector<Parameter> causes = common;
  for (Parameter& unknown : parameters_of(scene)) {
    const bool of_one = together && is_of_harmonic(unknown.key);
    if (quantity(unknown.key) == "constant" || of_one) continue;
    causes.push_back(std::move(unknown));
  }
  if (!keys.empty()) {
    causes.clear();
    for (const std::string& key : keys) causes.push_back(parameter_of(scene, key));
  }
  for (Parameter& unknown : causes) {
    const bool of_damping = tolerance_of(unknown) == "damping";
    unknown.within = of_damping ? 1.0 : quantity(unknown.key) == "frequency" ? 0.1 : 0.3;
  }
  if (!keys.empty()) return causes;
  for (Parameter& of_clock : clock_parameters(scene)) {
    if (of_clock.key == "clock.rate" || !is_phase) causes.push_back(std::move(of_clock));
  }
  return causes;
}

// Whether the parameter alone sets the scale of the motion, so that events cannot determine it.
bool is_the_scale(const Scene& scene, const Parameter& unknown) {
  if (!carries_scale(unknown)) return false;
  Model without = scene.model;
  for (const RecordedInput& record : recorded_inputs(scene)) {
    if (unknown.key == record.key + ".gain") {
      replace_input(record, nullptr, without);
      return is_homogeneous(without);
    }
  }
  return is_homogeneous(with(scene, unknown, 0.0).model);
}

std::string rate_ambiguity(const Scene& scene) {
  const Parameter rate = parameter_of(scene, "clock.rate");
  const std::optional<ClockAmbiguity> ambiguity = clock_ambiguity(scene, {rate}, rate);
  return ambiguity ? to_text(*ambiguity) : std::string();
}

// Whether one path follows nearly all events.
bool follows(const Identification& fit) {
  return fit.converged() && fit.problem != FitProblem::events_left_out &&
         fit.problem != FitProblem::lost_or_spurious_events;
}

class Judge {
 public:
  Judge(const Scene& scene, std::span<const ContactEvent> events, const DiagnosisSettings& settings)
      : scene_(scene), events_(events) {
    settings_.jitter = settings.jitter;
    settings_.begins = settings.begins;
    settings_.closed = settings.closed;
    settings_.progress = settings.progress;
  }

  /// The path of the machine as it is, with the widest scatter if there is none. Empty if there are
  /// too few events.
  std::optional<Identification> nominal() const {
    std::optional<Identification> fit = identified({}, false);
    if (fit && !follows(*fit)) fit->scatter = widest * fit->interval;
    return fit;
  }

  /// A fit with or without repairs of the events. Empty if no path follows them, or if there are
  /// too few.
  std::optional<Identification> fit(std::vector<Parameter> unknowns, bool mend = false) const {
    std::optional<Identification> fit = identified(std::move(unknowns), mend);
    return fit && follows(*fit) ? std::move(fit) : std::nullopt;
  }

  /// Fits of these sets of unknowns, on all cores; none of an empty set.
  std::vector<std::optional<Identification>> fits(
      const std::vector<std::vector<Parameter>>& trials) const {
    std::vector<std::optional<Identification>> fits(trials.size());
    in_parallel(cores(), static_cast<int>(trials.size()), [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      if (!trials[k].empty()) fits[k] = fit(trials[k]);
    });
    return fits;
  }

 private:
  std::optional<Identification> identified(std::vector<Parameter> unknowns, bool mend) const {
    IdentificationSettings settings = settings_;
    settings.unknowns = std::move(unknowns);
    settings.mend = mend;
    if (settings_.progress) {
      settings.progress = [this](std::string_view what) {
        const std::lock_guard lock(mutex_);
        settings_.progress(what);
      };
    }
    try {
      return identify(scene_, events_, settings);
    } catch (const TooFewImpacts&) {
      return std::nullopt;
    }
  }

  const Scene& scene_;
  std::span<const ContactEvent> events_;
  IdentificationSettings settings_;
  mutable std::mutex mutex_;  // of settings_.progress
};

double squares_of(const Identification& fit) { return fit.scatter * fit.scatter * fit.freedom; }

double scatter_of(const Identification& fit, double resolved) {
  return std::clamp(fit.scatter, resolved, std::max(widest * fit.interval, resolved));
}

double misfit_of(const Identification& fit, double scatter) {
  return squares_of(fit) / (scatter * scatter * std::max(fit.freedom, 1));
}

bool fits(const Identification& fit, double resolved) {
  return follows(fit) && misfit_of(fit, resolved) <= largest_misfit(fit.freedom);
}

double explained(double before, double left, double jitter) {
  const double all = before * before - jitter * jitter;
  if (!(all > 0.0)) return 0.0;
  return std::clamp(1.0 - (left * left - jitter * jitter) / all, 0.0, 1.0);
}

Candidate candidate_of(const Parameter& parameter, const std::optional<Identification>& fit,
                       const Identification& nominal, const Diagnosis& diagnosis) {
  Candidate candidate;
  candidate.parameter = parameter;
  candidate.value = parameter.nominal;
  candidate.scatter = diagnosis.scatter;
  if (!fit || !fit->unknowns.front().determined) return candidate;
  const FittedUnknown& of = fit->unknowns.front();
  const double scatter = scatter_of(*fit, diagnosis.resolved);
  const auto J = [&](const Identification& of_fit, double s) {
    return nominal.freedom * (misfit_of(of_fit, s) + 2.0 * std::log(s));
  };
  const double gain = J(nominal, diagnosis.scatter) - J(*fit, scatter);
  candidate.determined = of.sigma > 0.0 && gain > -significant_gain;
  if (!candidate.determined) return candidate;
  candidate.value = of.value;
  const double of_times =
      std::sqrt(std::max(of.sigma * of.sigma - of.of_record * of.of_record, 0.0));
  candidate.deviation =
      std::hypot(of_times * scatter / std::max(fit->jitter, fit->scatter), of.of_record);
  candidate.scatter = scatter;
  candidate.gain = gain;
  candidate.fits = fits(*fit, diagnosis.resolved);
  candidate.sensitivity = scatter / (candidate.deviation * std::sqrt(1.0 * fit->impacts));
  candidate.explained = explained(diagnosis.scatter, scatter, diagnosis.resolved);
  return candidate;
}

struct Found {
  Candidate candidate;
  std::optional<Identification> fit;
};

// Each parameter alone, the best first.
std::vector<Found> try_each(const Scene& scene, const std::vector<Parameter>& parameters,
                            const Judge& judge, const Identification& nominal,
                            const Diagnosis& diagnosis) {
  std::vector<std::vector<Parameter>> alone;
  for (const Parameter& parameter : parameters) {
    alone.emplace_back();
    if (!is_the_scale(scene, parameter)) alone.back().push_back(parameter);
  }
  std::vector<std::optional<Identification>> fits = judge.fits(alone);
  std::vector<Found> found;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    Candidate candidate = candidate_of(parameters[k], fits[k], nominal, diagnosis);
    found.push_back({std::move(candidate), std::move(fits[k])});
  }
  std::stable_sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return a.candidate.gain > b.candidate.gain;
  });
  return found;
}

// The first parameter that makes the events much more likely together with the best one; else
// empty. `sigma`: of the times [s], > 0, since exact times have no distribution to judge a gain by.
std::string key_of_second(const Parameter& best, const Identification& fit,
                          const std::vector<Parameter>& parameters, const Judge& judge,
                          double sigma) {
  std::vector<std::vector<Parameter>> pairs;
  for (const Parameter& second : parameters) {
    const bool common = is_common(second) || second.key.starts_with("impact.");
    const bool same =
        second.key == best.key || (common && quantity(second.key) == quantity(best.key));
    if (!same) pairs.push_back({best, second});
  }
  const std::vector<std::optional<Identification>> fits = judge.fits(pairs);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!fits[k]) continue;
    const double gain = squares_of(fit) - squares_of(*fits[k]);
    if (gain > gain_of_second * sigma * sigma) return pairs[k].back().key;
  }
  return {};
}

}  // namespace

const Candidate* Diagnosis::explanation() const {
  if (fits || is_repaired() || candidates.empty()) return nullptr;
  const Candidate& best = candidates.front();
  const bool alone = best.determined && best.fits && best.improved_by.empty();
  return alone && best.gain > significant_gain ? &best : nullptr;
}

std::vector<const Candidate*> Diagnosis::ties() const {
  std::vector<const Candidate*> ties;
  const Candidate* best = explanation();
  if (best == nullptr) return ties;
  for (const Candidate& other : candidates) {
    if (&other == best || !other.determined) continue;
    const bool as_good = best->gain - other.gain < significant_gain;
    if (as_good || (other.fits && jitter == 0.0)) ties.push_back(&other);
  }
  return ties;
}

const Candidate* Diagnosis::phase() const {
  for (const Candidate& candidate : candidates) {
    if (quantity(candidate.parameter.key) == "phase") return &candidate;
  }
  return nullptr;
}

Diagnosis diagnose(const Scene& scene, std::span<const ContactEvent> events,
                   const DiagnosisSettings& settings) {
  const std::vector<Parameter> parameters = single_causes(scene, settings.keys);
  const double jitter = settings.jitter;
  const int to_start = 2 * static_cast<int>(scene.model.coordinates());
  const int closings = closings_of(events, 1);
  const auto too_few = [&](const std::string& why) {
    return TooFewEvents("contacts close at " + std::to_string(closings) + " instants; " + why);
  };
  if (closings - to_start < least_more_closings) {
    throw too_few("this machine's state takes " + std::to_string(to_start) + " and its model " +
                  std::to_string(least_more_closings) + " more");
  }
  const Judge judge(scene, events, settings);
  const std::optional<Identification> nominal = judge.nominal();
  if (!nominal) throw too_few("not enough of them are in a row for this machine's state");
  Diagnosis diagnosis;
  diagnosis.scene = scene.name;
  diagnosis.from = events.front().t;
  diagnosis.to = events.back().t;
  diagnosis.only_frequency = only_frequency(scene.model);
  diagnosis.jitter = jitter;
  // Errors of a recorded input move the events as well.
  const double of_events = std::hypot(jitter, nominal->record_errors.scatter());
  diagnosis.resolved = std::max(of_events, exact * nominal->interval);
  diagnosis.closings = closings;
  diagnosis.unsure = closings_of(events, 2);
  diagnosis.misfit = misfit_of(*nominal, diagnosis.resolved);
  diagnosis.largest_misfit = largest_misfit(nominal->freedom);
  diagnosis.fits = fits(*nominal, diagnosis.resolved);
  diagnosis.scatter =
      diagnosis.fits ? diagnosis.resolved : scatter_of(*nominal, diagnosis.resolved);

  diagnosis.has_record = has_sampled_inputs(scene.model);
  if (!diagnosis.has_record) diagnosis.rate_ambiguity = rate_ambiguity(scene);
  std::vector<Found> found = try_each(scene, parameters, judge, *nominal, diagnosis);
  diagnosis.common_scatter = diagnosis.scatter;
  for (const Found& of : found) {
    diagnosis.common_scatter = std::min(diagnosis.common_scatter, of.candidate.scatter);
    // Exact times have no distribution to judge a gain by.
    if (jitter > 0.0 && of.candidate.gain > significant_gain) diagnosis.fits = false;
  }
  diagnosis.misfit_before = misfit_of(*nominal, diagnosis.common_scatter);
  for (Found& of : found) {
    if (of.fit) of.candidate.misfit = misfit_of(*of.fit, diagnosis.common_scatter);
    diagnosis.candidates.push_back(of.candidate);
  }
  if (!diagnosis.fits && diagnosis.explanation() == nullptr) {
    const std::optional<Identification> repaired = judge.fit({}, true);
    if (repaired && repaired->fits()) {
      diagnosis.missing = repaired->missing;
      for (const std::size_t i : repaired->spurious) diagnosis.spurious.push_back(events[i]);
    }
  }
  const Candidate* best = diagnosis.explanation();
  if (jitter > 0.0 && best != nullptr) {
    diagnosis.candidates.front().improved_by =
        key_of_second(best->parameter, *found.front().fit, parameters, judge, of_events);
  }
  return diagnosis;
}

}  // namespace sprag
