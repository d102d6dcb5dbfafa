#include "sprag/detail/identification/departure.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/identification/search.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Gain that names a cause which is one more unknown.
constexpr double least_gain = 14.0;
// Search for a noise: log10 of its ratio to the jitter's effect.
constexpr double lowest = -6.0, highest = 5.0, step = 0.5;

// A restitution changes by less, and an impact loses a smaller share of its speed.
constexpr double possible_change = 1.0;

// What a cause takes from the cost with the likeliest size that a machine can have. A contact lasts
// for less than the interval of events.
double possible_gain(const GaussNewton::Effect& effect, double most) {
  const double size = std::abs(effect.value);
  return size > most ? effect.gain * most * (2.0 * size - most) / square(size) : effect.gain;
}

class Departures {
 public:
  Departures(GaussNewton& solver, const EventFit& fit, const DepartureScale& scale)
      : solver_(&solver),
        fit_(&fit),
        scale_(scale),
        factor_(scale.jitter / fit.sigma),
        none_(at({})) {}

  struct Value {
    double log = 0.0;     // ln L
    double factor = 0.0;  // jitter over the fit's sigma
    Eigen::VectorXd changes, sigmas;
  };

  Value at(const FitNoise& noise) const {
    check_interrupt();
    // In units of the fit's sigma.
    const GaussNewton::Likelihood of = solver_->likelihood(*fit_, noise);
    Value value{0.0, factor_, of.changes, factor_ * of.sigmas};
    if (scale_.given) {
      value.log = -0.5 * (of.squares / square(factor_) + of.logs);
      return value;
    }
    const double freedom = fit_->freedom;
    value.factor = std::sqrt(of.squares / freedom);
    value.sigmas = value.factor * of.sigmas;
    value.log = -0.5 * (of.logs + freedom * (2.0 * std::log(value.factor) + 1.0));
    return value;
  }

  struct Best {
    double decade = 0.0;
    Value value;
    double gain = 0.0;
  };

  // `noise`: the noise at 10^decade.
  template <class Noise>
  Best most_likely(const Noise& noise) const {
    Best best{lowest, at(noise(lowest))};
    const auto look_at = [&](double decade) {
      Value next = at(noise(decade));
      if (!(next.log > best.value.log)) return false;
      best.value = std::move(next);
      best.decade = decade;
      return true;
    };
    for (double decade = lowest + step; decade <= highest; decade += step) look_at(decade);
    for (double shorter = 0.5 * step; shorter > 0.01; shorter *= 0.5) {
      const double middle = best.decade;
      if (!look_at(middle - shorter)) look_at(middle + shorter);
    }
    best.gain = 2.0 * (best.value.log - none_.log);
    return best;
  }

  DriftEstimate drift(const Scene& scene) const {
    const double unit = unit_of_drift(scene);
    const auto noise = [&](double decade) { return FitNoise{std::pow(10.0, decade) * unit, 0.0}; };
    const Best best = most_likely(noise);
    const auto drift_at = [&](double decade, const Value& value) {
      return noise(decade).drift * square(scale_.given ? factor_ : value.factor);
    };
    DriftEstimate estimate;
    const bool any = best.gain > 0.0;
    const Value& most = any ? best.value : none_;
    if (any) {
      estimate.drift = drift_at(best.decade, most);
      estimate.gain = best.gain;
    }
    estimate.jitter = most.factor * fit_->sigma;
    estimate.changes = most.changes;
    estimate.sigmas = most.sigmas;
    const auto end = [&](double outside) {
      double inside = best.decade;
      for (int i = 0; i < 10; ++i) {
        const double middle = 0.5 * (inside + outside);
        (at(noise(middle)).log > most.log - 0.5 * square(of_interval) ? inside : outside) = middle;
      }
      return drift_at(inside, at(noise(inside)));
    };
    // An estimated jitter adds its own uncertainty to the drift's.
    const double of_jitter = scale_.given ? 1.0 : 1.0 + 1.96 * std::sqrt(2.0 / fit_->freedom);
    if (none_.log < most.log - 0.5 * square(of_interval))
      estimate.low = end(lowest - 1.0) / of_jitter;
    estimate.high = end(highest + 1.0) * of_jitter;
    return estimate;
  }

  RestitutionScatter scatter() const {
    // The scatter of velocities that moves a usual event by the jitter.
    const double unit = fit_->sigma / scale_.interval;
    const Best best = most_likely([&](double decade) {
      return FitNoise{0.0, std::pow(10.0, 0.5 * decade) * unit};
    });
    RestitutionScatter estimate;
    if (!(best.gain > 0.0)) return estimate;
    const double of_jitter = scale_.given ? factor_ : best.value.factor;
    estimate.scatter = std::pow(10.0, 0.5 * best.decade) * unit * of_jitter;
    estimate.jitter = best.value.factor * fit_->sigma;
    estimate.gain = best.gain;
    estimate.changes = best.value.changes;
    estimate.sigmas = best.value.sigmas;
    return estimate;
  }

 private:
  // Drift that moves the gaps in a usual flight by as much as the fit's sigma.
  double unit_of_drift(const Scene& scene) const {
    Scene drifting = scene;
    drifting.prior.drift = 1.0;
    const Uncertainty uncertainty = uncertainty_of(drifting);
    double moves = 0.0;
    for (const Contact& contact : scene.model.contacts) {
      moves += (uncertainty.drift_q.transpose() * contact.w).squaredNorm() * scale_.interval +
               (uncertainty.drift_u.transpose() * contact.w).squaredNorm() *
                   std::pow(scale_.interval, 3);
    }
    return square(solver_->typical_speed() * fit_->sigma) / moves;
  }

  GaussNewton* solver_;
  const EventFit* fit_;
  DepartureScale scale_;
  double factor_;  // jitter over the fit's sigma
  Value none_;     // without a noise
};

}  // namespace

Departure estimate_departure(const Scene& scene, const std::vector<Parameter>& unknowns,
                             GaussNewton& solver, const EventFit& fit,
                             const DepartureScale& scale) {
  Departure departure;
  if (!(std::sqrt(fit.variance()) < largest_scatter * scale.interval)) return departure;
  const bool of_restitution = std::any_of(unknowns.begin(), unknowns.end(), [](const auto& of) {
    return quantity(of.key) == "restitution";
  });
  const Departures departures(solver, fit, scale);
  departure.drift = departures.drift(scene);
  if (of_restitution) departure.scatter = departures.scatter();
  // The cause that is one more unknown, by twice the rise of ln L.
  const auto effects = solver.effects(fit, {});
  const double freedom = std::max(fit.freedom - 1, 1);
  double largest = 0.0;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const double most = linear_causes[k] == Cause::soft_stop ? scale.interval : possible_change;
    const double cost = possible_gain(effects[k], most);
    double gain = cost * square(fit.sigma / scale.jitter), rise = gain;
    double least = least_gain;
    if (!scale.given) {
      const double share =
          std::min(cost * square(fit.sigma) / std::max(fit.squares, 1e-300), 1.0 - 1e-12);
      gain = share / (1.0 - share) * freedom;
      rise = -fit.freedom * std::log(1.0 - share);
      // A jitter of few events is uncertain.
      least *= 1.0 + 6.0 / freedom;
    }
    if (gain < least || rise < largest) continue;
    largest = rise;
    departure.cause = linear_causes[k];
  }
  // A noise is the cause if it gains as much. A scatter of the restitution is preferred to others
  // unless these are significantly likelier: with one contact, a drift is much like it.
  const std::optional<DriftEstimate>& drift = departure.drift;
  const std::optional<RestitutionScatter>& scatter = departure.scatter;
  if (drift->found() && drift->gain > largest) {
    departure.cause = Cause::drift;
    largest = drift->gain;
  }
  if (scatter && scatter->found() && scatter->gain > largest - significant_departure) {
    departure.cause = Cause::restitution_scatter;
  }
  if (!of_restitution) return departure;
  FitNoise noise;
  if (departure.is_drift()) noise.drift = drift->drift * square(fit.sigma / drift->jitter);
  if (departure.is_scatter()) {
    noise.restitution = scatter->scatter * fit.sigma / scatter->jitter;
  }
  const bool noisy = departure.is_drift() || departure.is_scatter();
  const GaussNewton::Effect effect = (noisy ? solver.effects(fit, noise) : effects).front();
  const GaussNewton::Likelihood without = solver.likelihood(fit, noise);
  const double to_jitter = square(fit.sigma / scale.jitter), speed = solver.typical_speed();
  RestitutionTrend trend;
  trend.chi2_without = without.squares * to_jitter;
  trend.chi2_with = (without.squares - effect.gain) * to_jitter;
  trend.gain = scale.given ? trend.chi2_without - trend.chi2_with
                           : fit.freedom * std::log(trend.chi2_without / trend.chi2_with);
  trend.trend = effect.value / speed;
  const double of_scatter =
      scale.given ? scale.jitter : fit.sigma * std::sqrt((without.squares - effect.gain) / freedom);
  trend.sigma = effect.sigma * of_scatter / fit.sigma / speed;
  // What is significant and impossible is no trend.
  if (!trend.found() || std::abs(effect.value) < possible_change) departure.trend = trend;
  return departure;
}

void include(const Departure& departure, Identification& result) {
  if (!departure.is_drift() && !departure.is_scatter()) return;
  const bool drifts = departure.is_drift();
  const Eigen::VectorXd& changes = drifts ? departure.drift->changes : departure.scatter->changes;
  const Eigen::VectorXd& sigmas = drifts ? departure.drift->sigmas : departure.scatter->sigmas;
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    FittedUnknown& fitted = result.unknowns[k];
    if (i >= sigmas.size() || !std::isfinite(sigmas[i])) continue;
    // The fit's value differs from the most likely one with the noise, by `changes`.
    fitted.widen(std::hypot(sigmas[i], changes[i]) * std::abs(fitted.unknown.slope(fitted.value)));
  }
}

}  // namespace sprag
