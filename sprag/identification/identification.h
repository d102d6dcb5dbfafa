// Parameters of a scene's machine from the times of its contact events alone: search.h finds where
// they are, maximum_likelihood.h what they are and how sure that is. What is found is believed only
// if the events then scatter by no more than their jitter,
//
//   chi^2 / freedom < 1 + 6 sqrt(2 / freedom),
//
// the machine meets every support from outside, and the first four fifths of the record predict the
// last one. Events that no machine explains are looked for one after the other, with what is known
// from those before: one that comes too early is spurious, before one that comes too late another
// was lost.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sprag/identification/maximum_likelihood.h"
#include "sprag/identification/record.h"
#include "sprag/identification/unknowns.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/event_gap.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

struct IdentificationSettings {
  std::vector<Unknown> unknowns;  ///< what is sought; may be empty
  std::optional<double> jitter;   ///< sigma of event times, >= 0 [s]; none: it is estimated
  double begins = 0.0;            ///< all events since then are known [s]
  ContactSet closed = 0;          ///< there
  std::vector<EventGap> gaps;     ///< where events may be missing, in order and apart
  bool mend = true;               ///< look for events that are spurious or were lost
  bool through_contact = true;    ///< follow the path where contacts stay closed as well
};

struct FittedUnknown {
  Unknown unknown;
  double value = 0.0;
  double sigma = 0.0;      ///< standard deviation
  bool determined = true;  ///< the events tell it
  /// The other unknown that hides in this one most, and their correlation; -1: there is none.
  int partner = -1;
  double correlation = 0.0;
};

/// An impact whose event is missing.
struct MissingImpact {
  double t = 0.0;
  int contact = 0;  ///< from 0
};

enum class FitProblem {
  none,
  misfit,         ///< what is left exceeds the jitter
  from_inside,    ///< the machine would meet a support from inside, or pass through it
  unpredictable,  ///< the first four fifths do not predict the last one
  not_found       ///< no minimum
};

struct Identification {
  FitProblem problem = FitProblem::none;
  std::vector<FittedUnknown> unknowns;
  Scene fitted;         ///< with the values, and the replica where the machine is
  double jitter = 0.0;  ///< as told, or as found [s]
  bool jitter_told = false;
  double scatter = 0.0;  ///< of events about the machine's own, root mean square by freedom [s]
  double chi2 = 0.0;     ///< sum of (tau - t)^2 / jitter^2
  double largest_chi2 = 0.0;  ///< that is believed
  int freedom = 0;
  int impacts = 0, stretches = 0;
  int left_out = 0;  ///< impacts of parts of the record that are too short to tell anything
  double from = 0.0, to = 0.0;
  double interval = 0.0;  ///< usual time between impacts [s]
  /// How far the impacts of the last fifth usually come from where the fit to the first four
  /// expects each, knowing those before it; and the same within the first four [s].
  double predicted = 0.0, predicted_before = 0.0;
  double first_squares = 0.0;  ///< of the first four fifths alone [s^2]
  int first_freedom = 0;
  State start, start_sigma;  ///< at start_t
  double start_t = 0.0;
  std::vector<std::size_t> spurious;  ///< numbers of events
  std::vector<MissingImpact> missing;
  Likelihood likelihood;  ///< the solution: path and covariance; its stretches are `measured`
  Stretches measured;
  /// Values, of all unknowns, of other minima that fit as well.
  std::vector<Eigen::VectorXd> others;

  bool fits() const { return problem == FitProblem::none; }
  bool ambiguous() const { return !others.empty(); }
};

/// Too few impacts to say anything.
struct TooFewImpacts : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws TooFewImpacts, ModelError where M is not positive definite, and Interrupted
/// (interrupt.h).
Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings);

/// Which of the unknowns together explain the events, as few as do: none where the scene as it is
/// fits, single ones, else pairs.
struct Explanation {
  std::vector<std::string> keys;  ///< empty: the scene as it is
  Identification fit;
};
struct Explanations {
  /// Those with the fewest unknowns, the best first; empty: no two explain them.
  std::vector<Explanation> simplest;
};

/// Judges them by the jitter `jitter` [s]: that of the events, or what a fit of all has left.
Explanations explain(const Scene& scene, std::span<const ContactEvent> events,
                     const IdentificationSettings& settings, double jitter);

}  // namespace sprag
