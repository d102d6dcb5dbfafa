// How well a model predicts contact events, by the innovations of a filter that it drives
// (linear_filter.h; prediction-error method; Ljung, "System Identification", 2nd ed., ch. 7). At
// each instant where contacts close the filter expects a gap r with variance S, and r = 0 happened.
// The event's time is what is measured, so that the likelihood has S / gamma^2, the variance of the
// time:
//
//   J = -2 log L = sum r_k^2 / S_k + log(S_k / gamma_k^2).
//
// The first 2 f closings only determine the state and do not count.
#pragma once

#include <cstdint>
#include <span>

#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

/// Where the events begin: all since t [s] are known, and which contacts were closed then.
struct Beginning {
  double t = 0.0;
  ContactSet closed = 0;
};

struct Prediction {
  double J = 0.0;           ///< -2 log likelihood, up to a constant; infinity where there is none
  double misfit = 0.0;      ///< mean of r^2 / S; 1 where model and jitter are right
  double length = 0.0;      ///< largest term of a gap [m]
  double inside = 0.0;      ///< share of the time for which a contact was inside before it closed
  int count = 0;            ///< closings that count
  std::int64_t unsure = 0;  ///< impacts of several contacts of which not all is known
};

/// Closings that only determine the state: 2 f.
int closings_to_start(const Scene& scene);

/// Instants at which contacts close.
int closings_of(std::span<const ContactEvent> events);

/// Runs the filter over the events from the scene's replica start (at the beginning), with the
/// scene's uncertainty, with `model` and event times that jitter by `jitter` > 0 [s]. `inside`
/// takes longer and is found on demand. A machine that has no exact flow gives J = infinity.
Prediction predict(const Scene& scene, const Model& model, double jitter,
                   std::span<const ContactEvent> events, bool with_inside = false,
                   const Beginning& beginning = {});

}  // namespace sprag
