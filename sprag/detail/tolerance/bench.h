// Simulated runs of a scene's machine with disturbed events, or with a wrong parameter in the
// observers, and the V of (23) (Baumann & Leine 2014) that each observer reaches.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/detail/replica/any_replica.h"
#include "sprag/detail/study/disturbance.h"
#include "sprag/detail/study/study_file.h"
#include "sprag/detail/study/trial.h"
#include "sprag/detail/tolerance/deviations.h"

namespace sprag::tolerance {

struct Settings {
  double target = 0.0;    ///< of V; 0: usual_target times the energy of the machine's motion
  double duration = 0.0;  ///< of a run [s]; 0: chosen by the replica's convergence
  /// Of event times, in all runs except those that vary the jitter [s]; 0: the scene's.
  double jitter = 0.0;
  double drift = 0.0;  ///< drift that filters assume, energy per unit of time; 0: the scene's
  int runs = 7;        ///< runs for each amount
  std::vector<EstimatorKind> estimators = {EstimatorKind::replica, EstimatorKind::timing,
                                           EstimatorKind::both};
};

inline constexpr double usual_target = 1e-4;

/// The machine's runs, which all deviations share. The first starts at the scene's start. The
/// others start at random states that differ from it by a tenth of the energy of the motion.
class Bench {
 public:
  /// Throws Error if contacts do not close, ModelError (also if an adaptive estimator does not
  /// exist), SimulationError or Interrupted.
  Bench(const Scene& scene, const Settings& settings, int threads);

  const Scene& scene() const { return scene_; }
  const Settings& settings() const { return settings_; }
  double target() const { return target_; }
  /// Mean of V between the motion and its own mean, in the second half of the first run.
  double motion_energy() const { return motion_energy_; }
  double duration() const { return duration_; }
  double closings_per_time() const { return closings_per_time_; }

  const study::Truth& truth(int run) const { return truths_[static_cast<std::size_t>(run)]; }
  /// The run's events with the disturbance, in order of arrival.
  std::vector<ContactEvent> arrived(const study::Disturbance& disturbance, int run) const;

  /// Figures of each estimator in run `run`. V_floor is infinite if the observer's model does not
  /// exist. `deviation` null: no deviation. Throws Interrupted.
  std::vector<study::Figures> figures(const Deviation* deviation, double amount, int run) const;

 private:
  Scene scene_;
  Settings settings_;
  double target_ = 0.0, motion_energy_ = 0.0, duration_ = 0.0, closings_per_time_ = 0.0;
  std::vector<study::Truth> truths_;
};

}  // namespace sprag::tolerance
