// Diagnosis of a model by contact events: whether the events fit a scene's machine and, if not,
// which single parameter and which value of it would explain them best. Each parameter is
// identified alone (sprag/identification.h); all others keep the scene's values.
//
// The fit of a parameter is compared with that of the nominal machine by J = -2 log L, up to a
// constant,
//
//   J = n (mean (tau - t)^2 / s^2 + log s^2),
//
// with the degrees of freedom n of the nominal fit and the *scatter* s of the event times, at least
// the resolution of times. A parameter explains the events only if they fit with its value and the
// jitter alone, and no second parameter makes them significantly more likely.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/error.h"
#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag {

struct Candidate {
  Parameter parameter;
  /// Whether the events determine the parameter. If false, `value` is the nominal one and `gain` is
  /// 0.
  bool determined = false;
  double value = 0.0;
  double deviation = 0.0;    ///< standard deviation of the value
  double sensitivity = 0.0;  ///< root mean square shift of the events per unit of the value [s]
  double scatter = 0.0;      ///< scatter of event times in this fit [s]
  double misfit = 0.0;       ///< mean square of the residuals, in units of common_scatter
  double gain = 0.0;         ///< J of the nominal model minus J, both at their own scatter
  double explained = 0.0;    ///< share of the nominal scatter's square above the jitter
  bool fits = false;         ///< the events fit with this value and the jitter alone
  /// For the best candidate: the key of another parameter that explains significantly more together
  /// with it; else empty.
  std::string improved_by;

  double change() const { return value - parameter.nominal; }
};

struct Diagnosis {
  std::string scene;
  int closings = 0;  ///< closings that are used
  double from = 0.0, to = 0.0;
  double jitter = 0.0;  ///< specified jitter [s]; 0: exact
  /// The jitter with the scatter by errors of recorded inputs, at least the resolution of times
  /// [s].
  double resolved = 0.0;
  double scatter = 0.0;  ///< scatter of event times about the nominal model [s]
  /// Misfit of the nominal model with the jitter, per degree of freedom.
  double misfit = 0.0;
  double largest_misfit = 0.0;  ///< largest misfit of a fit
  double common_scatter = 0.0;  ///< smallest scatter of all fits, the unit of all misfits [s]
  double misfit_before = 0.0;   ///< misfit of the nominal model in that unit
  int unsure = 0;               ///< instants at which several contacts close, which are ignored
  bool fits = false;
  std::vector<Candidate> candidates;  ///< best first
  /// Repairs of the events, if they do not fit as recorded but fit the nominal model after the
  /// repairs.
  std::vector<MissingImpact> missing;
  std::vector<ContactEvent> spurious;
  /// Why the rate of the contact clock cannot be determined; empty: it can.
  std::string rate_ambiguity;
  /// A recorded input drives the machine: its clock is taken as that of the events, but for a
  /// delay.
  bool has_record = false;
  /// Common frequency of all harmonics, if they have one; a clock offset is then a phase.
  double only_frequency = 0.0;

  /// Whether lost or spurious events explain the misfit.
  bool is_repaired() const { return !missing.empty() || !spurious.empty(); }
  /// The parameter that explains the misfit, null if none does: with its value the events fit.
  const Candidate* explanation() const;
  /// Other parameters that explain the misfit as well, so that the events do not distinguish them.
  std::vector<const Candidate*> ties() const;
  /// The first phase among the candidates, or null.
  const Candidate* phase() const;
};

struct DiagnosisSettings {
  double jitter = 0.0;    ///< sigma of event times, >= 0 [s]; 0: exact
  double begins = 0.0;    ///< all events after this time are known [s]
  ContactSet closed = 0;  ///< contacts that are closed then
  /// Keys of the parameters that may be wrong; empty: all.
  std::vector<std::string> keys = {};
  /// Called with what is being tried, by one thread at a time; may be empty.
  std::function<void(std::string_view)> progress = {};
};

/// There are too few events for a diagnosis.
struct TooFewEvents : Error {
  using Error::Error;
};

/// Throws TooFewEvents, std::invalid_argument for a key that the scene does not have, and
/// ModelError if M is not positive definite.
Diagnosis diagnose(const Scene& scene, std::span<const ContactEvent> events,
                   const DiagnosisSettings& settings);

}  // namespace sprag
