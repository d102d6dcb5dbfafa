#include "sprag/detail/identification/fit.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "sprag/detail/identification/judgement.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Events closer together than this cannot be distinguished: in usual intervals, with a given jitter
// and without one.
constexpr double close_if_given = 1e-6, close_in_intervals = 3e-4;

std::string keys_of(const std::vector<Parameter>& unknowns) {
  std::string keys;
  for (const Parameter& unknown : unknowns) keys += (keys.empty() ? "" : ", ") + unknown.key;
  return keys.empty() ? "the start alone" : keys;
}

class Fitter {
 public:
  Fitter(const Scene& scene, std::span<const ContactEvent> events,
         const IdentificationSettings& settings)
      : context_{scene, events, settings, record_},
        solver_(scene, settings.unknowns, settings.strictly_within) {
    if (is_homogeneous(scene.model)) solver_.fix_speed();
    const double interval = usual_interval(events);
    const double close = settings.jitter
                             ? std::max(six * *settings.jitter, close_if_given * interval)
                             : close_in_intervals * interval;
    solver_.flight().set(VectorXd::Zero(solver_.parameters()), false);
    record_ = fit_record(events, settings, close, solver_.flight());
    require_enough();
  }

  EventIdentification run() {
    const IdentificationSettings& settings = context_.settings;
    EventIdentification best = identified(settings.jitter, settings.mend, negligible_scatter);
    if (!settings.retry) return best;
    // The times may scatter by more than the given jitter: one path through more of the events.
    if (settings.jitter && is_broken(best)) {
      take_longer(identified(std::nullopt, settings.mend, negligible_scatter), best);
    }
    if (settings.approximate && is_broken(best)) {
      take_longer(identified(std::nullopt, false, largest_scatter), best);
    }
    return best;
  }

 private:
  // Whether no path follows nearly all of the events.
  static bool is_broken(const EventIdentification& of) {
    const FitProblem problem = of.result.problem;
    return problem == FitProblem::no_convergence || problem == FitProblem::events_left_out ||
           problem == FitProblem::merged_bounces || problem == FitProblem::lost_or_spurious_events;
  }

  static void take_longer(EventIdentification other, EventIdentification& best) {
    if (other.result.problem == FitProblem::no_convergence) return;
    const bool longer = best.result.problem == FitProblem::no_convergence ||
                        other.result.stretches < best.result.stretches ||
                        other.fit.events() > best.fit.events();
    if (longer) best = std::move(other);
  }

  // `jitter`, `changes` and `neglected`: for the search. The verdict is by the given jitter.
  EventIdentification identified(std::optional<double> jitter, bool changes, double neglected) {
    FitSearch search(solver_, record_, jitter, changes, neglected, progress());
    std::vector<Chain> chains = search.run();
    EventIdentification identified;
    if (chains.empty()) {
      identified.result.problem = FitProblem::no_convergence;
      identified.result.fitted = context_.scene;
      identified.result.interval = record_.interval;
      identified.result.freedom = static_cast<int>(search.usable());
      return identified;
    }
    chains.front().sort_by_time();
    if (context_.settings.progress) {
      context_.settings.progress(keys_of(context_.settings.unknowns) + ": intervals and causes");
    }
    identified.result = judge(context_, solver_, search, chains);
    identified.fit = std::move(chains.front().fit);
    return identified;
  }

  // Reports what is tried.
  std::function<void(std::size_t)> progress() const {
    const auto& report = context_.settings.progress;
    if (!report) return {};
    return [&report, tried = keys_of(context_.settings.unknowns),
            all = record_.events](std::size_t events) {
      report(tried + ": a path through " + std::to_string(events) + " of " + std::to_string(all) +
             " events");
    };
  }

  // An estimated jitter is an unknown, too: it needs more equations than unknowns.
  void require_enough() const {
    const auto P = static_cast<std::size_t>(solver_.parameters());
    const auto of_start = static_cast<std::size_t>(2 * solver_.n());
    if (record_.stretches.empty() || record_.stretches.front().size() < of_start + 2) {
      throw TooFewImpacts("no part of the record has " + std::to_string(of_start + 2) +
                          " single impacts in a row; the start alone takes " +
                          std::to_string(of_start));
    }
    const bool given = context_.settings.jitter.has_value();
    std::size_t counted = 0, stretches = 0;
    for (const FitStretch& stretch : record_.stretches) {
      if (stretch.size() < of_start + 2) continue;
      counted += stretch.size();
      ++stretches;
    }
    const std::size_t needed = P * (given ? 1 : 2) + of_start * stretches + 2;
    if (counted >= needed) return;
    throw TooFewImpacts("the record has " + std::to_string(counted) + " impacts that count; " +
                        std::to_string(needed) + " are needed at least for " +
                        std::to_string(P + of_start * stretches) + " unknowns" +
                        (given ? "" : " and a jitter that is not given"));
  }

  FitRecord record_;
  SearchContext context_;
  GaussNewton solver_;
};

}  // namespace

EventIdentification fit_events(const Scene& scene, std::span<const ContactEvent> events,
                               const IdentificationSettings& settings) {
  const std::vector<RecordedInput> records = recorded_inputs(scene);
  const bool noisy = std::any_of(records.begin(), records.end(), [](const RecordedInput& record) {
    return record.input->noise() > 0.0;
  });
  if (!noisy) return Fitter(scene, events, settings).run();
  // A noisy record makes event times scatter by more than their jitter, and not independently.
  IdentificationSettings of_record = settings;
  of_record.jitter.reset();
  of_record.white = false;
  return Fitter(scene, events, of_record).run();
}

}  // namespace sprag
