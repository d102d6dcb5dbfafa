// Whether contact events fit a scene's machine and, if not, which of its parameters, wrong by
// itself, would explain them best, and by what value.
//
// A wrong model cannot be followed with event times as exact as they are. So times are allowed to
// scatter by the smallest sigma with which the mean of r^2 / S is 1: the model's *scatter*. Each
// parameter is searched by maximum likelihood (prediction.h), coarsely over its range at smaller
// scatters than the nominal model's, then from the best of these places, again and again with the
// scatter that is left at the best value, until that no longer falls. A frequency, which turns late
// events by whole periods, is searched on few events first. With J as a parabola around its lowest
// value, J'' gives the standard deviation sqrt(2 / J'').
//
// A parameter explains the events only if they fit with its value and the jitter alone, and no
// second one beside it makes them significantly likelier.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "sprag/estimation/parameters.h"
#include "tools/diagnose/prediction.h"

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
  double misfit = 0.0;       ///< mean r^2 / S at the smallest scatter of all candidates
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
  double misfit = 0.0;          ///< of the scene's own model with the jitter: mean r^2 / S
  double largest_misfit = 0.0;  ///< that still fits
  double common_scatter = 0.0;  ///< at which misfits are compared: the smallest of all [s]
  double misfit_before = 0.0;   ///< of the scene's own model at that scatter
  std::int64_t unsure = 0;      ///< impacts that the filter could not take exactly
  bool fits = false;
  std::vector<Candidate> candidates;  ///< best first
  double only_frequency = 0.0;        ///< of all harmonics; a clock offset is then a phase

  /// The parameter that explains the misfit, if one does: with its value the events fit.
  const Candidate* explanation() const;
  /// Others that explain it as well: the events do not tell them apart.
  std::vector<const Candidate*> ties() const;
};

/// Too few events to say anything.
struct TooFewEvents : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// `jitter` >= 0 [s]. Throws TooFewEvents, and ModelError if the scene's own machine has no exact
/// flow.
Diagnosis diagnose(const Scene& scene, std::span<const ContactEvent> events, double jitter,
                   const Beginning& beginning = {});

}  // namespace sprag
