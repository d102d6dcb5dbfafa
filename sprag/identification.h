// Identifies parameters of a scene's machine from the times of its contact events alone.
//
//   1. search.h finds candidates by variable projection on windows of impacts;
//   2. maximum_likelihood.h refines each with the true event times among the unknowns;
//   3. a candidate is a solution if it has converged, its times scatter as their jitter does,
//
//        chi^2 / freedom < 1 + 6 sqrt(2 / freedom),
//
//      and the machine meets every support from outside;
//   4. where none is, mending.h looks for lost and spurious events;
//   5. determination.h finds by the likelihood which parameters the events determine;
//   6. the first four fifths of the record must predict the last one.
//
// The result has one verdict (FitProblem); no other part of a report judges the fit.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/identification/departure.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/record.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

struct IdentificationSettings {
  std::vector<Unknown> unknowns;     ///< what is sought; may be empty
  std::optional<double> jitter;      ///< sigma of event times, >= 0 [s]; none: it is estimated
  double begins = 0.0;               ///< all events since then are known [s]
  ContactSet closed = 0;             ///< there
  std::vector<EventGap> gaps;        ///< where events may be missing, in order and apart
  bool mend = true;                  ///< look for events that are spurious or were lost
  std::vector<std::size_t> guessed;  ///< numbers of events whose times are guesses
  bool through_contact = true;       ///< follow the path where contacts stay closed as well
  bool white = true;                 ///< without a jitter, refuse a scatter that is not white
  /// Refuse values outside of Unknown::within, although the search reaches farther.
  bool strictly_within = true;
};

struct FittedUnknown {
  Unknown unknown;
  double value = 0.0;
  double sigma = 0.0;      ///< standard deviation
  bool determined = true;  ///< the events determine it; otherwise value and sigma mean nothing
  double low = 0.0, high = 0.0;  ///< 95 % interval
  /// The likelihood is largest at a physical bound, which is `value`. The other one of `low` and
  /// `high` is a one-sided 95 % limit.
  bool at_bound = false;
  /// The other determined unknown with the largest correlation, and that correlation; -1: none.
  int partner = -1;
  double correlation = 0.0;
};

/// A combination of undetermined unknowns that the events determine: sum of weight times relative
/// change from the nominal value (of phases: change in rad; of clearances: in usual lengths).
struct Combination {
  std::vector<std::pair<std::size_t, double>> weights;  ///< numbers of unknowns; norm 1
  double sigma = 0.0;
};

/// An impact whose event is missing.
struct MissingImpact {
  double t = 0.0;
  int contact = 0;  ///< from 0
};

/// Why a fit is refused; the first that holds.
enum class FitProblem {
  none,
  no_convergence,           ///< no optimum was found at which the machine has these impacts
  events_left_out,          ///< the fit uses less than 90 % of the events
  merged_bounces,           ///< the model has many impacts closer than any recorded
  lost_or_spurious_events,  ///< between two impacts the machine would be inside a support
  bound_reached,            ///< a parameter ends at or beyond the range it is sought in
  degenerate_orbit,         ///< the events determine only combinations of parameters
  wrong_model               ///< what is left is not the jitter
};

/// What shows that a model is wrong.
enum class Misfit {
  none,
  scatter,     ///< times scatter by more than their jitter
  structured,  ///< the scatter that would be the jitter depends on the path
  prediction,  ///< the first four fifths do not predict the last one
  start        ///< the motion at the start is far larger than on the path
};

struct Identification {
  FitProblem problem = FitProblem::none;
  Misfit misfit = Misfit::none;  ///< of FitProblem::wrong_model, and of a bound that is reached so
  int culprit = -1;              ///< the unknown of FitProblem::bound_reached
  std::vector<FittedUnknown> unknowns;
  std::vector<Combination> combinations;  ///< of FitProblem::degenerate_orbit
  Scene fitted;                           ///< with the values, and the replica where the machine is
  double jitter = 0.0;                    ///< as told, or as found [s]
  bool jitter_given = false;
  double scatter = 0.0;  ///< of events about the machine's own, root mean square by freedom [s]
  double chi2 = 0.0;     ///< sum of (tau - t)^2 / jitter^2
  double largest_chi2 = 0.0;  ///< that is believed
  int freedom = 0;
  int impacts = 0, stretches = 0;
  int events = 0;             ///< events at which a contact closes
  int left_out = 0;           ///< of them, those that the fit does not use
  int spurious_left_out = 0;  ///< of these, spurious ones; the others lie in parts that are too
                              ///< short or contradict the rest
  double from = 0.0, to = 0.0;
  double interval = 0.0;  ///< usual time between impacts [s]
  /// How far the impacts of the last fifth usually come from where the fit to the first four
  /// expects each, knowing those before it; and the same within the first four [s].
  double predicted = 0.0, predicted_before = 0.0;
  double first_squares = 0.0;  ///< of the first four fifths alone [s^2]
  int first_freedom = 0;
  State start, start_sigma;  ///< at start_t
  double start_t = 0.0;
  double inside_from = 0.0, inside_to = 0.0;  ///< of FitProblem::lost_or_spurious_events [s]
  std::vector<std::size_t> spurious;          ///< numbers of events
  std::vector<MissingImpact> missing;
  Likelihood likelihood;  ///< the solution: path and covariance; its stretches are `measured`
  Stretches measured;
  Departure departure;  ///< what is found beside the jitter; in the sigmas of the unknowns
  /// Values, of all unknowns, of other minima that fit as well.
  std::vector<Eigen::VectorXd> others;

  bool fits() const { return problem == FitProblem::none; }
  bool ambiguous() const { return !others.empty(); }
  /// Whether there are values at all, of a fit that may be refused.
  bool converged() const { return problem != FitProblem::no_convergence; }
  double used_share() const {
    return events > 0 ? 1.0 - static_cast<double>(left_out) / events : 0.0;
  }
};

/// Too few impacts to say anything.
struct TooFewImpacts : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws TooFewImpacts, ModelError where M is not positive definite, and Interrupted
/// (interrupt.h).
Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings);

}  // namespace sprag
