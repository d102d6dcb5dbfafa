// Options --free, --known and --within.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

struct SoughtOptions {
  /// "all", or keys separated by commas; empty: all that the events can determine.
  std::string free;
  std::string known;   ///< keys separated by commas
  std::string within;  ///< a value without a key applies to all others
};

/// The unknowns to identify. Amplitudes, constant forces and clearances have a common unobservable
/// scale, so one of them is held: the one that --known names, else an amplitude. Throws UsageError.
std::vector<Unknown> sought(const Scene& scene, const SoughtOptions& options);

/// The unknowns that may be wrong alone: the sought ones and the one that is held for its scale.
std::vector<Unknown> single_causes(const Scene& scene, const std::vector<Unknown>& sought);

/// The key that is held to fix the scale; empty if none has to be.
std::string held_for_scale(const Scene& scene, const std::vector<Unknown>& sought);

}  // namespace sprag
