// Reference solutions that are independent of this program: 50 digits from tests/reference, or a
// closed form.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag::work_precision {

struct ReferenceImpact {
  double t;            ///< [s]
  double gamma_minus;  ///< [m/s], negative
};

struct Reference {
  /// In order, up to the horizon. Chatters are recorded down to a least impact velocity.
  std::vector<ReferenceImpact> impacts;
  double sample_step = 0.5;  ///< [s]
  Eigen::MatrixXd q, u;      ///< f x samples, at k sample_step up to the horizon
  /// End of the comparison of methods [s]: amplified rounding errors are still small.
  double horizon = 0.0;
  /// End of the early part [s]: an error of the method has grown by a factor of about ten at most.
  double early = 0.0;
};

/// Names of the scenes that have a reference, in the order of the charts.
std::span<const std::string> reference_scenes();

/// The reference of such a scene; files come from `directory` (tests/reference). Throws InputError
/// for a missing or damaged file or a name without a reference, and ModelError if the closed form
/// does not fit the scene.
Reference reference(const Scene& scene, const std::filesystem::path& directory);

/// A mass that falls from rest onto a fixed floor, in closed form: sampled every sample_step [s] up
/// to and including the horizon [s]; impacts until gamma_minus is below 1e-12 m/s. Throws
/// ModelError for any other machine.
Reference bouncing_mass(const Model& model, const State& start, double horizon, double sample_step);

}  // namespace sprag::work_precision
