// Guaranteed half-widths of a scene with tolerances, for reports.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sprag/detail/bound/certified_floor.h"
#include "sprag/scene.h"

namespace sprag {

struct GuaranteedWidths {
  CertifiedFloor floor;
  double duration = 0.0;  ///< of the trial run [s]
  std::string why_none;   ///< why nothing is guaranteed; empty if something is
  /// Half-widths of the scene's outputs, or of its gaps if it has no outputs, at the largest B late
  /// in the run.
  std::vector<std::pair<std::string, double>> widths;
};

/// Finds the half-widths by a trial run of the scene's master with exact event times. Empty if the
/// scene has no tolerances. Throws ModelError or Interrupted.
std::optional<GuaranteedWidths> guaranteed_widths(const Scene& scene);

/// "guaranteed: tip within 2.1 mm at 0.1 ms"; empty without tolerances.
std::string guaranteed_text(const Scene& scene, const std::optional<GuaranteedWidths>& widths);

}  // namespace sprag
