// Runs of a scene's machine whose events are disturbed, or whose observers have a parameter wrong,
// and what V of (23) then comes down to.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/detail/replica/any_replica.h"
#include "tools/study/disturbance.h"
#include "tools/study/study_file.h"
#include "tools/study/trial.h"
#include "tools/tolerance/deviations.h"

namespace sprag::tolerance {

struct Settings {
  double target = 0.0;    ///< of V; 0: usual_target of the energy of the machine's motion
  double duration = 0.0;  ///< of a run [s]; 0: chosen by what the replica needs
  double jitter = 0.0;    ///< of event times in all runs but those of jitter [s]; 0: the scene's
  double drift = 0.0;     ///< that filters are told, energy per unit of time; 0: the scene's
  int runs = 7;           ///< of each amount
  std::vector<EstimatorKind> estimators = {EstimatorKind::replica, EstimatorKind::timing,
                                           EstimatorKind::both};
};

inline constexpr double usual_target = 1e-4;

/// The machine's own runs, which all deviations share. The first one begins as the scene does, the
/// others off by a tenth of the energy of the motion, in directions that are drawn.
class Bench {
 public:
  /// Throws Error where contacts do not close, ModelError, also where there is no adaptive
  /// estimator, SimulationError or Interrupted.
  Bench(const Scene& scene, const Settings& settings, int threads);

  const Scene& scene() const { return scene_; }
  const Settings& settings() const { return settings_; }
  double target() const { return target_; }
  /// Mean of V between the machine and its own mean, in the second half of the first run.
  double motion_energy() const { return motion_energy_; }
  double duration() const { return duration_; }
  double closings_per_time() const { return closings_per_time_; }

  const study::Truth& truth(int run) const { return truths_[static_cast<std::size_t>(run)]; }
  /// The run's events as they arrive, disturbed.
  std::vector<ContactEvent> arrived(const study::Disturbance& disturbance, int run) const;

  /// What comes of each estimator in run `run`: V_floor is infinite where the observer's model does
  /// not exist. Null: nothing is off. Throws Interrupted.
  std::vector<study::Figures> figures(const Deviation* deviation, double amount, int run) const;

 private:
  Scene scene_;
  Settings settings_;
  double target_ = 0.0, motion_energy_ = 0.0, duration_ = 0.0, closings_per_time_ = 0.0;
  std::vector<study::Truth> truths_;
};

}  // namespace sprag::tolerance
