// What --free, --known and --within say.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

struct SoughtOptions {
  std::string free;    ///< "all", or keys with commas between; empty: what the events can tell
  std::string known;   ///< keys with commas between
  std::string within;  ///< "0.2", "beam.damping=1,0.1": of all that are not named
};

/// The unknowns that are sought. Of what only a common scale tells apart, amplitudes, constant
/// forces and clearances, what --known names is held, else an amplitude. Throws UsageError.
std::vector<Unknown> sought(const Scene& scene, const SoughtOptions& options);

/// Those that may be wrong by themselves: what is sought, and what is held for its scale.
std::vector<Unknown> single_causes(const Scene& scene, const std::vector<Unknown>& sought);

/// The key that is held for the scale of what is sought; empty where none has to be.
std::string held_for_scale(const Scene& scene, const std::vector<Unknown>& sought);

}  // namespace sprag
