#include "sprag/detail/identification/verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sprag {
namespace {

std::string plural(std::size_t n, const std::string& noun) {
  return std::to_string(n) + ' ' + noun + (n == 1 ? "" : "s");
}

std::size_t determined(const Identification& fit) {
  return static_cast<std::size_t>(
      std::count_if(fit.unknowns.begin(), fit.unknowns.end(),
                    [](const FittedUnknown& unknown) { return unknown.determined; }));
}

std::string share(const Identification& fit) {
  return short_number(100.0 * fit.used_share(), 3) + " %";
}

// The likeliest cause of a misfit.
std::string of_cause(const Identification& fit) {
  switch (fit.departure.cause) {
    case Cause::restitution_by_speed: {
      const auto& trend = fit.departure.trend;
      const std::string form = trend && trend->trend < 0.0
                                   ? "value = ..., slope = " + short_number(trend->trend, 2)
                                   : "at = [...], value = [...]";
      return "The likeliest cause: the restitution depends on the impact's speed. The scene can "
             "say so: restitution = { " +
             form + " }.";
    }
    case Cause::restitution_scatter:
      return "The likeliest cause: the restitution scatters from impact to impact.";
    case Cause::drift:
      return "The likeliest cause: the motion drifts from the model at random, by a disturbance or "
             "a missing mode.";
    case Cause::restitution_by_time:
      return "The likeliest cause: the restitution changes during the record.";
    case Cause::friction:
      return "The likeliest cause: each impact loses a constant speed, as by friction.";
    case Cause::soft_stop:
      return "The likeliest cause: contacts last, as at a stop that gives way.";
    case Cause::clock_rate:
      return "The likeliest cause: the contact clock runs at another rate; free clock.rate.";
    case Cause::none:
      break;
  }
  return "No cause that is looked for explains it: the restitution, friction, a soft stop, a drift "
         "or the clock.";
}

std::string of_wrong_model(const Identification& fit) {
  switch (fit.misfit) {
    case Misfit::prediction:
      return "The fit to the first four fifths of the record does not predict the last fifth. "
             "Something changes meanwhile, or the model lacks an effect. " +
             of_cause(fit);
    case Misfit::structured:
      return "The scatter of the event times depends on the motion, so that it is not a jitter. "
             "The model lacks an effect or a mode, or a parameter that is not sought is wrong. " +
             of_cause(fit);
    default:
      return "The event times scatter by " + short_number(fit.scatter, 3) +
             (fit.jitter_given
                  ? " s, more than their jitter of " + short_number(fit.jitter, 3) +
                        " s. The jitter is specified too small, the model lacks an "
                        "effect or a mode, or"
                  : " s, which is no jitter. The model lacks an effect or a mode, or") +
             " a parameter that is not sought is wrong. " + of_cause(fit);
  }
}

// Whether a recorded input may be the reason for a wrong model.
std::string of_record(const Identification& fit) {
  const RecordErrors& errors = fit.record_errors;
  if (!errors.explains(fit.scatter)) return "";
  return " Noise and interpolation of the recorded input alone explain a scatter of " +
         short_number(errors.scatter(), 2) + " s: a faster or better record comes first.";
}

}  // namespace

std::string short_number(double value, int digits) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.*g", digits, value == 0.0 ? 0.0 : value);
  return buffer;
}

std::string rounded_to_sigma(double value, double sigma) {
  constexpr int usual = 6, most = 10;
  if (!(sigma > 0.0) || value == 0.0) return short_number(value, usual);
  const double digits =
      std::floor(std::log10(std::abs(value))) - std::floor(std::log10(sigma)) + 2.0;
  return short_number(value, static_cast<int>(std::clamp<double>(digits, 2, most)));
}

std::string pace_of_clock(double rate) {
  constexpr double many_ppm = 1e-2;
  const double error = std::abs(rate - 1.0);
  if (error == 0.0) return "true";
  const std::string size = error < many_ppm ? short_number(1e6 * error, 4) + " ppm"
                                            : short_number(100.0 * error, 4) + " %";
  return size + (rate > 1.0 ? " fast" : " slow");
}

const char* name_of(Cause cause) {
  switch (cause) {
    case Cause::restitution_by_speed:
      return "restitution_by_speed";
    case Cause::restitution_scatter:
      return "restitution_scatter";
    case Cause::drift:
      return "drift";
    case Cause::restitution_by_time:
      return "restitution_by_time";
    case Cause::friction:
      return "friction";
    case Cause::soft_stop:
      return "soft_stop";
    case Cause::clock_rate:
      return "clock_rate";
    case Cause::none:
      break;
  }
  return "none";
}

const char* name_of(FitProblem problem) {
  switch (problem) {
    case FitProblem::no_convergence:
      return "no_convergence";
    case FitProblem::events_left_out:
      return "events_left_out";
    case FitProblem::merged_bounces:
      return "merged_bounces";
    case FitProblem::lost_or_spurious_events:
      return "lost_or_spurious_events";
    case FitProblem::bound_reached:
      return "bound_reached";
    case FitProblem::degenerate_orbit:
      return "degenerate_orbit";
    case FitProblem::wrong_model:
      return "wrong_model";
    default:
      return "none";
  }
}

std::string verdict_of(const Identification& fit) {
  switch (fit.problem) {
    case FitProblem::no_convergence:
      return "no fit: no optimum was found";
    case FitProblem::events_left_out:
      return "no fit: only " + share(fit) + " of the events are explained";
    case FitProblem::merged_bounces:
      return "no fit: the sensor merges bounces that the model has";
    case FitProblem::lost_or_spurious_events:
      return "no fit: events are lost or spurious";
    case FitProblem::bound_reached:
      return "no fit within the given ranges";
    case FitProblem::degenerate_orbit:
      return fit.combinations.empty()
                 ? "no unique fit: other values explain the events as well"
                 : "no unique fit: the orbit determines only combinations of the parameters";
    case FitProblem::wrong_model:
      return "no fit: the model is wrong";
    default:
      break;
  }
  if (fit.unknowns.empty()) return "the events fit the scene as it is";
  const std::size_t found = determined(fit);
  std::string text = "the events fit";
  if (found == 0) {
    text += " the scene as it is, and determine none of the parameters";
  } else {
    text += ", with " + plural(found, "parameter") + " as found";
    if (found < fit.unknowns.size()) {
      text += "; " + std::to_string(fit.unknowns.size() - found) + " not determined";
    }
  }
  return text;
}

std::string reason_of(const Identification& fit) {
  switch (fit.problem) {
    case FitProblem::none:
      return "";
    case FitProblem::no_convergence:
      return "At no values within the ranges does the search converge to a machine with these "
             "impacts. Try other --within, fewer parameters, or check the scene.";
    case FitProblem::events_left_out: {
      const int others = fit.left_out - fit.spurious_left_out;
      std::string text = "Of " + plural(static_cast<std::size_t>(fit.events), "event") + ", " +
                         std::to_string(fit.left_out) + " are not used: ";
      if (fit.spurious_left_out > 0) text += std::to_string(fit.spurious_left_out) + " spurious";
      if (fit.spurious_left_out > 0 && others > 0) text += ", ";
      if (others > 0) {
        text += std::to_string(others) +
                " in parts that contradict the rest, or that are cut by near impacts or sustained "
                "contacts";
      }
      return text +
             ". At least 90 % must be used. The likeliest reasons: a wrong model, or a sensor "
             "that reports several events for an impact." +
             (fit.departure.cause == Cause::none ? "" : " " + of_cause(fit));
    }
    case FitProblem::merged_bounces:
      return "Many impacts of the model follow others sooner than any recorded event does. The "
             "sensor "
             "merges such bounces. Keep fewer modes (`reduce`), so that the model has no faster "
             "bounces than the sensor resolves.";
    case FitProblem::lost_or_spurious_events:
      return "Between t = " + short_number(fit.inside_from, 9) + " and " +
             short_number(fit.inside_to, 9) +
             " the machine would have other impacts than the record. Events are lost there or "
             "spurious, more than can be told, or the scene's contacts are wrong.";
    case FitProblem::bound_reached: {
      const FittedUnknown& of = fit.unknowns[static_cast<std::size_t>(fit.culprit)];
      if (quantity(of.unknown.key) == "delay") {
        return of.unknown.key + " ends at the end of the range in which it is sought, " +
               short_number(of.unknown.unit_step * of.unknown.highest(), 2) + " s about " +
               short_number(of.unknown.nominal, 6) +
               " s, half of the record's mean period. Specify a nominal delay that is nearer, or "
               "the model is wrong.";
      }
      return of.unknown.key + " ends at or beyond the range in which it is sought, " +
             short_number(100.0 * of.unknown.within, 3) + " % about " +
             short_number(of.unknown.nominal, 6) +
             ". Either it is off by more, and a larger --within helps, or the model is wrong.";
    }
    case FitProblem::degenerate_orbit: {
      std::string text;
      if (!fit.combinations.empty()) {
        text += "Determined are:";
        for (const Combination& of : fit.combinations) {
          text += of.weights.size() > 0 ? " " : "";
          for (std::size_t i = 0; i < of.weights.size(); ++i) {
            const auto [number, weight] = of.weights[i];
            text += (i > 0 ? (weight < 0.0 ? " - " : " + ") : (weight < 0.0 ? "-" : "")) +
                    short_number(std::abs(weight), 2) + " " + fit.unknowns[number].unknown.key;
          }
          text += " (sigma " + short_number(of.sigma, 2) + ");";
        }
        text.back() = ',';
        text += " in relative changes. ";
      }
      return text + "Hold what is known with --known, or record a transient.";
    }
    case FitProblem::wrong_model:
      return of_wrong_model(fit) + of_record(fit);
  }
  return "";
}

}  // namespace sprag
