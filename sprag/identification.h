/// \file
/// \brief Identifies parameters of a machine from the times of its contact events alone.
///
/// 1. search.h finds candidates by variable projection on windows of impacts.
/// 2. maximum_likelihood.h refines each, with the true event times among the unknowns.
/// 3. A candidate is a solution if it has converged, if the machine meets every support from
///    outside, and if its times scatter as their jitter does:
///    chi^2 / freedom < 1 + 6 sqrt(2 / freedom).
/// 4. If there is none, mending.h looks for missed and spurious detections.
/// 5. determination.h finds by the profile likelihood which parameters the events determine.
/// 6. The first four fifths of the recording must predict the last fifth.
///
/// Recorded inputs: their response is computed again for every machine. 7. record_errors.h adds the
/// effect of their noise and resolution. If their samples have a stated noise, the jitter is
/// estimated even if it is given, because the noise makes event times scatter as well.
///
/// The result has one verdict (FitProblem). No other part of a result judges the fit. Contacts,
/// events and unknowns are counted from 0.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/identification/departure.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"
#include "sprag/detail/identification/record_errors.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/error.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Parameters to identify, and properties of the recording.
struct IdentificationSettings {
  std::vector<Unknown> unknowns;     ///< parameters to identify; may be empty
  std::optional<double> jitter;      ///< sigma of event times, >= 0 [s]; empty: estimated
  double begins = 0.0;               ///< the recording is complete from here on [s]
  ContactSet closed = 0;             ///< contacts that are closed at `begins`
  std::vector<EventGap> gaps;        ///< where events may be missing, in order and disjoint
  bool mend = true;                  ///< look for missed and spurious detections
  std::vector<std::size_t> guessed;  ///< indices of events whose times are guesses
  bool through_contact = true;       ///< follow the path through sustained contacts
  bool white = true;                 ///< without a jitter, refuse a scatter that is not white
  /// \brief Refuse values outside of Unknown::within, although the search covers a larger range.
  bool strictly_within = true;
};

/// \brief Result for one parameter.
struct FittedUnknown {
  Unknown unknown;         ///< the parameter
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
  /// \brief Whether the recorded inputs limit the accuracy, not the events.
  /// \return true if about half of the variance or more is theirs.
  bool is_limited_by_record() const { return of_record > 0.7 * sigma || of_record == infinity; }
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
  prediction,  ///< the first four fifths do not predict the last fifth
  start        ///< the motion at the start is far larger than on the path
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
  double first_squares = 0.0;  ///< sum of squares of the first four fifths alone [s^2]
  int first_freedom = 0;       ///< degrees of freedom of the first four fifths
  State start, start_sigma;    ///< state at `start_t` and its standard deviations
  double start_t = 0.0;        ///< machine's time by the fitted clock [s]
  double begins = 0.0;         ///< begin of the recording, machine's time by the fitted clock [s]
  double inside_from = 0.0, inside_to = 0.0;  ///< for FitProblem::lost_or_spurious_events [s]
  std::vector<std::size_t> spurious;          ///< indices of spurious events
  std::vector<MissingImpact> missing;         ///< impacts without an event
  Likelihood likelihood;       ///< the solution: path and covariance, for the stretches `measured`
  Stretches measured;          ///< impacts with their measured times
  Departure departure;         ///< other causes of scatter than jitter; included in the sigmas
  RecordErrors record_errors;  ///< errors of the recorded inputs; included in the sigmas
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
