// Whether contact events fit a scene's machine and, if not, which of its parameters, wrong by
// itself, would explain them best, and by what value: each is sought alone by identification
// (sprag/identification.h), with all else as the scene says.
//
// A fit is compared with that of the scene's own machine by J = -2 log L, up to a constant,
//
//   J = n (mean (tau - t)^2 / s^2 + log s^2),
//
// n being the freedom of the scene's own, s the *scatter* that is left of event times, or what is
// as good as exact. A parameter explains the events only if they fit with its value and the jitter
// alone, and no second one beside it makes them significantly likelier.
#pragma once

#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/parameters/parameters.h"
#include "sprag/identification.h"
#include "sprag/scene.h"

namespace sprag {

struct Candidate {
  Parameter parameter;
  /// Whether the events tell it at all: otherwise `value` is the nominal one, and nothing is
  /// gained.
  bool told = false;
  double value = 0.0;
  double deviation = 0.0;    ///< standard deviation of the value
  double sensitivity = 0.0;  ///< how far events move, root mean square, per unit of the value [s]
  double scatter = 0.0;      ///< of event times that is left [s]
  double misfit = 0.0;       ///< mean square of what is left, at the smallest scatter of all
  double gain = 0.0;         ///< J of the nominal model minus J, both at their own scatter
  double explained = 0.0;    ///< share of the nominal scatter's square above the jitter
  bool fits = false;         ///< with this value the events fit with the jitter alone
  /// Of the best: another parameter that with this one explains significantly more; else empty.
  std::string improved_by;
};

struct Diagnosis {
  std::string scene;
  int closings = 0;  ///< that count
  double from = 0.0, to = 0.0;
  double jitter = 0.0;          ///< of event times, as told; 0: exact
  double resolved = 0.0;        ///< the jitter, or what is as good as exact [s]
  double scatter = 0.0;         ///< of event times that the scene's own model needs [s]
  double misfit = 0.0;          ///< of the scene's own model with the jitter, by freedom
  double largest_misfit = 0.0;  ///< that still fits
  double common_scatter = 0.0;  ///< at which misfits are compared: the smallest of all [s]
  double misfit_before = 0.0;   ///< of the scene's own model at that scatter
  int unsure = 0;               ///< instants at which several contacts close, which are left out
  bool fits = false;
  std::vector<Candidate> candidates;  ///< best first
  /// Where the events do not fit as they are, but fit the scene's own model once these are
  /// repaired.
  std::vector<MissingImpact> missing;
  std::vector<ContactEvent> spurious;
  double only_frequency = 0.0;  ///< of all harmonics; a clock offset is then a phase

  /// Whether lost or spurious events explain the misfit.
  bool is_repaired() const { return !missing.empty() || !spurious.empty(); }
  /// The parameter that explains the misfit, if one does: with its value the events fit.
  const Candidate* explanation() const;
  /// Others that explain it as well: the events do not tell them apart.
  std::vector<const Candidate*> ties() const;
};

/// Where the events begin: all since t [s] are known, and which contacts were closed then.
struct Beginning {
  double t = 0.0;
  ContactSet closed = 0;
};

/// Too few events to say anything.
struct TooFewEvents : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// `jitter` >= 0 [s]. Throws TooFewEvents, and ModelError where M is not positive definite.
Diagnosis diagnose(const Scene& scene, std::span<const ContactEvent> events, double jitter,
                   const Beginning& beginning = {});

}  // namespace sprag
