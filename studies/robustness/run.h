// One run: a machine, what an observer is told of it, and the error energy V of its estimate.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/scene.h"

namespace sprag::robustness {

/// V is sampled in the second half of a run.
struct Sampling {
  double duration = 200.0;
  double interval = 0.1;  ///< of V; a multiple of both ticks
  double tick = 1e-2;     ///< of the exact methods
  double moreau_tick = 1e-3;

  std::int64_t first() const;  ///< number of the first sample: t = first() interval
  std::int64_t last() const;
};

/// A master's run.
struct Truth {
  Model model;
  std::vector<ContactEvent> events;
  Eigen::MatrixXd q, u;  ///< a column each sample
};

/// Throws SimulationError.
Truth simulate(const Scene& scene, const Sampling& sampling);

enum class Method {
  replica,
  moreau,
  forced,  ///< ForcedReplica
  timing,
  both,
  timing_untold,  ///< the filter takes event times to be exact
  both_untold,
  timing_drift,  ///< the filter takes its model to depart by `usual_drift`
  both_drift,
};

/// Energy by which a model is taken to depart from the machine, per unit of time.
inline constexpr double usual_drift = 1e-4;

std::string name(Method method);

/// V at the samples, +infinity where the estimate is not finite. `believed` is the machine as the
/// observer knows it, with the start of its estimate and `jitter` as it is told; it may have fewer
/// coordinates than the truth: what they lack counts as zero.
std::vector<double> error_energies(Method method, Scene believed,
                                   std::span<const ContactEvent> events, const Truth& truth,
                                   const Sampling& sampling);

/// What an observer has: as in error_energies.
struct Told {
  Scene believed;
  std::vector<ContactEvent> events;
};

/// The same with Method::replica for one to eight runs of machines of one structure, in a sweep
/// (replica_sweep.h): bit for bit what error_energies gives for each. `truths` are as many.
std::vector<std::vector<double>> replica_energies(std::span<const Told> runs,
                                                  std::span<const Truth> truths,
                                                  const Sampling& sampling);

}  // namespace sprag::robustness
