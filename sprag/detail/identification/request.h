// An identification as a user asks for it: parameters by their keys, and a result with all that its
// text shows. The program `identify` and the Python package call it.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sprag/detail/identification/explanations.h"

namespace sprag {

struct IdentifyRequest {
  /// Keys of the parameters to identify; without: all that the events can determine.
  std::optional<std::vector<std::string>> free;
  std::vector<std::string> known;           ///< keys of correct ones; a clearance sets the scale
  std::optional<double> within;             ///< relative error of those not in `within_of`
  std::map<std::string, double> within_of;  ///< relative error by key
  std::optional<double> jitter;             ///< [s]; empty: the scene's, or estimated without
  bool causes = false;                      ///< search single parameters that explain the events
  bool accept = false;                      ///< take a wrong model as an effective one
};

struct IdentifyResult {
  std::string scene;
  Identification fit;
  bool accepted = false;          ///< by request, although the fit was refused
  bool asked_for_causes = false;  ///< whether `causes` were searched
  Explanations causes;
  std::string held;  ///< key that is held to fix the scale; empty: none
  std::vector<ContactEvent> events;
};

/// Whether a significant drift was found.
inline bool drifts(const IdentifyResult& result) { return result.fit.departure.is_drift(); }

/// The unknowns to identify. Amplitudes, constant forces and clearances have a common unobservable
/// scale, so one of them is held: the one that `known` names, else an amplitude. Throws
/// std::invalid_argument.
std::vector<Parameter> sought(const Scene& scene, const IdentifyRequest& request);

/// The key that is held to fix the scale; empty if none has to be.
std::string held_for_scale(const Scene& scene, const std::vector<Parameter>& sought);

/// Identifies. `settings` has the gaps and the begin of the recording. The causes are searched only
/// if the events fit. Throws std::invalid_argument and what identify() throws.
IdentifyResult identify_requested(const Scene& scene, std::span<const ContactEvent> events,
                                  const IdentifyRequest& request,
                                  IdentificationSettings settings = {});

}  // namespace sprag
