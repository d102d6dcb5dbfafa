/// \file
/// \brief Identifies parameters of a machine from the times of its contact events alone.
///
/// One least-squares problem over the parameters, the starts of the stretches and the true times of
/// the events (gauss_newton.h). The search begins on a window of events, grows it to the whole
/// record, and inserts or drops an event where the record cannot be followed and the likelihood
/// gains (search.h). A table of checks gives the verdict (judgement.h): the search has converged,
/// and the fit uses at least 90 % of the events; no value is beyond its range; the times scatter as
/// their jitter, chi^2 / freedom < 1 + 6 sqrt(2 / freedom), and no departure from the model
/// explains them better (Cause); the first four fifths of the record predict the last fifth; other
/// values do not explain the events as well.
///
/// Recorded inputs: record_errors.h adds the effect of their noise and resolution. If their samples
/// have a stated noise, the jitter is estimated even if it is given, because the noise makes event
/// times scatter as well.
///
/// The result has one verdict (FitProblem). No other part of a result judges the fit. Contacts,
/// events and unknowns are counted from 0.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/error.h"
#include "sprag/parameter.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Parameters to identify, and properties of the recording.
struct IdentificationSettings {
  std::vector<Parameter> unknowns;   ///< parameters to identify; may be empty
  std::optional<double> jitter;      ///< sigma of event times, >= 0 [s]; empty: estimated
  double begins = 0.0;               ///< the recording is complete from here on [s]
  ContactSet closed = 0;             ///< contacts that are closed at `begins`
  std::vector<EventGap> gaps;        ///< where events may be missing, in order and disjoint
  bool mend = true;                  ///< look for missed and spurious detections
  std::vector<std::size_t> guessed;  ///< indices of events whose times are guesses
  bool white = true;                 ///< without a jitter, refuse a scatter that is not white
  /// \brief If no path explains the events to their jitter, look for one that follows them roughly:
  /// the model is an approximation.
  bool approximate = false;
  /// \brief Where no path explains the events, follow them with a larger scatter, for the reasons
  /// of a refusal.
  bool retry = true;
  /// \brief Refuse values outside of Parameter::within, although the search covers a larger range.
  bool strictly_within = true;
  /// \brief Called with what is being tried, before each attempt; may be empty.
  std::function<void(std::string_view)> progress = {};
};

/// \brief Result for one parameter.
struct FittedUnknown {
  Parameter unknown;       ///< the parameter
  double value = 0.0;      ///< identified value
  double sigma = 0.0;      ///< standard deviation
  bool determined = true;  ///< the events determine it; false: value and sigma are meaningless
  double low = 0.0, high = 0.0;  ///< 95 % interval
  /// \brief The likelihood is largest at a physical bound, which is `value`. The other end of the
  /// interval is a one-sided 95 % limit.
  bool at_bound = false;
  int partner = -1;          ///< determined unknown with the largest correlation; -1: none
  double correlation = 0.0;  ///< correlation with `partner`
  double of_record = 0.0;    ///< part of `sigma` by errors of recorded inputs
  /// \brief Raises the standard deviation, and the interval with it.
  /// \param to new standard deviation; a smaller one changes nothing.
  void widen(double to);
  /// \brief Whether the recorded inputs limit the accuracy, not the events.
  /// \return true if about half of the variance or more is theirs.
  bool is_limited_by_record() const { return of_record > 0.7 * sigma || std::isinf(of_record); }
};

/// \brief A combination of undetermined unknowns that the events determine.
///
/// It is the sum of weight times relative change from the nominal value. For a phase the change is
/// in rad, for a clearance in typical lengths of the machine.
struct Combination {
  std::vector<std::pair<std::size_t, double>> weights;  ///< index of unknown and weight; norm 1
  double sigma = 0.0;                                   ///< standard deviation of the combination
};

/// \brief An impact without an event.
struct MissingImpact {
  double t = 0.0;   ///< [s]
  int contact = 0;  ///< from 0
};

/// \brief Why a fit is refused: the first reason that holds.
enum class FitProblem {
  none,                     ///< the fit is accepted
  no_convergence,           ///< no optimum was found at which the machine has these impacts
  events_left_out,          ///< the fit uses less than 90 % of the events
  merged_bounces,           ///< the model has many impacts closer together than any recorded
  lost_or_spurious_events,  ///< between two impacts the machine would be inside a support
  bound_reached,            ///< a parameter ends at or beyond the range of the search
  degenerate_orbit,         ///< other values of the parameters explain the events
  wrong_model               ///< the residuals are not the jitter
};

/// \brief Evidence that a model is wrong.
enum class Misfit {
  none,        ///< none
  scatter,     ///< times scatter by more than their jitter
  structured,  ///< residuals that should be the jitter depend on the path
  prediction   ///< the first four fifths do not predict the last fifth
};

/// \brief The events cannot determine a parameter of the clock.
struct ClockAmbiguity {
  std::string key;  ///< "clock.rate" or "clock.offset"
  /// \brief Sought parameters whose change together equals a change of `key`; empty: nothing in the
  /// machine has a unit of time.
  std::vector<std::string> equals;
};

/// \brief Difference of a recorded time from the fit's.
struct EventResidual {
  double t = 0.0;         ///< recorded time [s]
  int contact = 0;        ///< from 0
  std::size_t event = 0;  ///< number in the record
  double residual = 0.0;  ///< recorded minus fitted time [s]
  /// \brief Standard deviation that the jitter gives the residual; 0: the fit follows the time
  /// exactly [s].
  double sigma = 0.0;
  bool closes = true;  ///< a contact closes; false: it opens
};

/// \brief Departures from the model that an identification looks for besides the jitter.
enum class Cause {
  none,                  ///< none is significant
  restitution_by_speed,  ///< the restitution depends on the impact's speed
  restitution_scatter,   ///< the restitution scatters from impact to impact
  drift,                 ///< the motion drifts from the model at random
  restitution_by_time,   ///< the restitution changes steadily during the record
  friction,              ///< each impact loses a constant speed
  soft_stop,             ///< contacts last: a stop gives way
  clock_rate             ///< the contact clock runs at another rate
};

/// \brief A gain, twice the rise of ln L, above this is significant. Without an error of the kind
/// it is chi^2 distributed with one degree of freedom.
inline constexpr double significant_departure = 9.0;

/// \brief Process noise that explains the scatter of the residuals.
struct DriftEstimate {
  double drift = 0.0;   ///< most likely drift, energy per unit of time
  double jitter = 0.0;  ///< most likely jitter with this drift [s]
  /// \brief Ends of the 95 % interval, where ln L is lower by 1.92. `low` is 0 if no drift lies in
  /// the interval.
  double low = 0.0, high = 0.0;
  double gain = 0.0;  ///< twice the rise of ln L
  /// \brief With this drift, in the unknowns' coordinates: their changes from the fit and their
  /// standard deviations.
  Eigen::VectorXd changes, sigmas;

  /// \brief Whether it is significant.
  /// \return true if it is.
  bool found() const { return gain > significant_departure; }
};

/// \brief Scatter of the restitution from impact to impact.
struct RestitutionScatter {
  double scatter = 0.0;  ///< standard deviation of the restitution of one impact, the most likely
  double jitter = 0.0;   ///< most likely jitter with this scatter [s]
  double gain = 0.0;     ///< twice the rise of ln L
  Eigen::VectorXd changes, sigmas;  ///< as DriftEstimate's

  /// \brief A larger estimate is no scatter of the machine's restitution: the model is another one.
  static constexpr double largest = 0.03;
  /// \brief Whether it is significant and not too large.
  /// \return true if it is.
  bool found() const { return gain > significant_departure && scatter < largest; }
};

/// \brief Trend of the restitution with the speed of the impact.
struct RestitutionTrend {
  double trend = 0.0, sigma = 0.0;  ///< d epsilon / d |gamma-|, per unit of speed
  /// \brief chi^2 of the residuals, in units of the specified or fitted jitter, without and with
  /// the trend.
  double chi2_without = 0.0, chi2_with = 0.0;
  double gain = 0.0;  ///< chi2_without - chi2_with

  /// \brief Whether it is significant.
  /// \return true if it is.
  bool found() const { return gain > significant_departure; }
};

/// \brief Other causes of scatter than the jitter of event times.
struct Departure {
  Cause cause = Cause::none;                  ///< the likeliest, if it is significant
  std::optional<DriftEstimate> drift;         ///< empty if the fit does not determine it
  std::optional<RestitutionScatter> scatter;  ///< empty if the restitution was not sought
  /// \brief Beside a significant drift or scatter; empty if the restitution was not sought.
  std::optional<RestitutionTrend> trend;

  /// \brief Whether a drift is the likeliest cause.
  /// \return true if it is.
  bool is_drift() const { return cause == Cause::drift; }
  /// \brief Whether a scatter of the restitution is the likeliest cause.
  /// \return true if it is.
  bool is_scatter() const { return cause == Cause::restitution_scatter; }
};

/// \brief Standard deviations by errors of the recorded inputs, in the unknowns' coordinates, P
/// entries; empty without a record.
struct RecordErrors {
  Eigen::VectorXd noise;       ///< by the stated noise of the samples
  Eigen::VectorXd resolution;  ///< by the interpolation between samples
  State start;                 ///< of the state at the first stretch's start, by both
  /// \brief Scatter of the event times that these errors cause [s].
  double noise_scatter = 0.0, resolution_scatter = 0.0;
  /// \brief Scatter with the other interpolation, if that is far smaller than the fit's; else 0
  /// [s].
  double other_scatter = 0.0;

  /// \brief Whether there is no record.
  /// \return true if there is none.
  bool empty() const { return resolution.size() == 0; }
  /// \brief The larger one of both scatters.
  /// \return the scatter [s].
  double scatter() const { return std::max(noise_scatter, resolution_scatter); }
  /// \brief Whether they explain the scatter of a fit.
  /// \param of_fit scatter of the fit [s].
  /// \return true if they do.
  bool explains(double of_fit) const { return scatter() > 0.3 * of_fit; }
  /// \brief Standard deviation by both.
  /// \param k number of the unknown, from 0.
  /// \return the deviation.
  double of(std::size_t k) const;
};

/// \brief Result of identify().
struct Identification {
  FitProblem problem = FitProblem::none;  ///< verdict
  Misfit misfit =
      Misfit::none;  ///< for FitProblem::wrong_model, and for a bound reached by scatter
  int culprit = -1;  ///< index of the unknown of FitProblem::bound_reached; -1: none
  /// \brief In the order of the settings; those of `ambiguities` last.
  std::vector<FittedUnknown> unknowns;
  std::vector<ClockAmbiguity> ambiguities;  ///< unknowns of the clock that were held at nominal
  std::vector<Combination> combinations;    ///< for FitProblem::degenerate_orbit
  /// \brief The scene with all that the fit determines: values, their uncertainty and correlations,
  /// start, jitter and drift (fitted_scene.h). `identify --output` writes it.
  Scene fitted;
  double jitter = 0.0;             ///< as given, or as estimated [s]
  bool jitter_given = false;       ///< the settings gave the jitter
  double scatter = 0.0;            ///< root of the residuals' squares per degree of freedom [s]
  double chi2 = 0.0;               ///< sum of (tau - t)^2 / jitter^2
  double largest_chi2 = 0.0;       ///< largest chi2 that is accepted
  int freedom = 0;                 ///< degrees of freedom
  int impacts = 0, stretches = 0;  ///< impacts used, and uninterrupted parts they form
  int events = 0;                  ///< events at which a contact closes
  int left_out = 0;                ///< those of `events` that the fit does not use
  int spurious_left_out = 0;    ///< those of `left_out` that are spurious; the others lie in parts
                                ///< that are too short or contradict the rest
  double from = 0.0, to = 0.0;  ///< first and last impact used [s]
  double interval = 0.0;        ///< typical time between impacts [s]
  /// \brief Typical error of predicting each impact of the last fifth from those before it, with
  /// the fit to the first four fifths; and the same error within the first four fifths [s].
  double predicted = 0.0, predicted_before = 0.0;
  State start, start_sigma;  ///< state at `start_t` and its standard deviations
  double start_t = 0.0;      ///< machine's time by the fitted clock [s]
  double begins = 0.0;       ///< begin of the recording, machine's time by the fitted clock [s]
  double inside_from = 0.0, inside_to = 0.0;  ///< for FitProblem::lost_or_spurious_events [s]
  std::vector<std::size_t> spurious;          ///< indices of spurious events
  std::vector<MissingImpact> missing;         ///< impacts without an event
  /// \brief Covariance in the unknowns' coordinates, P x P; 0 for an unknown that is held or at a
  /// bound.
  Eigen::MatrixXd covariance;
  std::vector<EventResidual> residuals;  ///< of the events used, in order of time
  Departure departure;                   ///< other causes of scatter than jitter
  RecordErrors record_errors;            ///< of the recorded inputs; included in the sigmas
  /// \brief Values of all unknowns at other minima that fit as well.
  std::vector<Eigen::VectorXd> others;

  /// \brief Whether the fit is accepted.
  /// \return true if it is.
  bool fits() const { return problem == FitProblem::none; }
  /// \brief Whether other minima fit as well.
  /// \return true if some do.
  bool ambiguous() const { return !others.empty(); }
  /// \brief Whether there are values, of a fit that may be refused.
  /// \return true if there are.
  bool converged() const { return problem != FitProblem::no_convergence; }
  /// \brief Share of the events that the fit uses.
  /// \return 0 to 1.
  double used_share() const {
    return events > 0 ? 1.0 - static_cast<double>(left_out) / events : 0.0;
  }
};

/// \brief The recording has too few impacts for the unknowns.
struct TooFewImpacts : Error {
  using Error::Error;
};

/// \brief Identifies parameters of a machine.
///
/// A parameter of the contact clock that the events cannot determine by the structure of the
/// machine (clock_ambiguity.h) is held at its nominal value and reported as not determined.
///
/// \param scene machine with nominal values.
/// \param events in order of time, the machine's time by the nominal clock; contacts from 0.
/// \param settings parameters, jitter and gaps.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return values, deviations and the verdict.
/// \throws TooFewImpacts if the recording has too few impacts.
/// \throws ModelError if M is not positive definite.
/// \throws Interrupted if `stop` was requested.
Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings, std::stop_token stop = {});

}  // namespace sprag
