// Options --free, --known and --within.
#pragma once

#include <string>

#include "sprag/detail/identification/request.h"
#include "sprag/scene.h"

namespace sprag {

struct SoughtOptions {
  /// "all", or keys separated by commas; empty: all that the events can determine.
  std::string free;
  std::string known;   ///< keys separated by commas
  std::string within;  ///< a value without a key applies to all others
};

/// What to identify. The causes are searched if no parameters are named. Throws UsageError.
IdentifyRequest request_of(const Scene& scene, const SoughtOptions& options);

}  // namespace sprag
