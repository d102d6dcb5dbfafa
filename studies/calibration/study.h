// The calibration study. For a machine and a jitter it runs an estimator many times on the master's
// jittered events, and compares its errors with its claimed standard deviations.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/scene.h"
#include "studies/calibration/statistics.h"
#include "studies/common/disturbance.h"

namespace sprag::calibration {

/// Start of the estimate.
enum class Start {
  scene,   ///< the start of the scene
  prior,   ///< new for each seed: the master's start plus an error of the scene's uncertainty
  machine  ///< start of the scene; a new master start for each seed, off by the scene's uncertainty
};

/// Disturbances of an estimator besides jitter.
enum class Trouble {
  none,
  spurious,  ///< additional pulses, a tenth of the number of events
  missing,   ///< a tenth of the events is lost
  mixed,     ///< both
  wrong      ///< one parameter of the model, another each seed, is off by 1 to 5 %
};

struct Options {
  int seeds = 200;        ///< 1, 2, ...; a fifth of them for machines of more than 40 coordinates
  double duration = 0.0;  ///< 0: usual_duration(), limited to 2500 events
  double tick = 0.0;      ///< 0: a twenty-thousandth of the duration, to one digit
  int samples = 800;      ///< of the errors, over the whole duration
  Start start = Start::scene;
  Trouble trouble = Trouble::none;
  ConfidenceLevel confidence = ConfidenceLevel::high;
  int threads = 2;
};

/// A run of the master, and its states at sampled ticks.
struct Truth {
  std::vector<ContactEvent> events;
  double duration = 0.0, tick = 0.0;
  std::int64_t stride = 1;  ///< ticks a sample
  Eigen::MatrixXd q, u;     ///< a column each sample, sample 0 at tick `stride`
};

/// Throws SimulationError, or std::invalid_argument if no duration is given and the machine has no
/// usual duration.
Truth simulate(const Scene& scene, const Options& options);

/// Runs a started estimator through all ticks of `truth`, with the events as they arrive. Calls
/// on_tick(k) at ticks with events and on_sample(sample) at sampled ticks.
template <Estimator E, typename OnTick, typename OnSample>
void run(E& estimator, typename E::State& state, std::span<const ContactEvent> events,
         const Truth& truth, const OnTick& on_tick, const OnSample& on_sample) {
  auto next = events.begin();
  const std::int64_t last = truth.q.cols() * truth.stride;
  for (std::int64_t k = 1; k <= last; ++k) {
    const auto first = next;
    while (next != events.end() && next->t <= tick_instant(k, truth.tick).hi) ++next;
    estimator.tick({first, next}, state);
    if (first != next) on_tick(k);
    if (k % truth.stride == 0) on_sample(k / truth.stride - 1);
  }
}

/// One run. `given` is the scene of the estimator, with its specified jitter and start; `events`
/// are in order of arrival.
Trial follow(EstimatorKind estimator, const Scene& given, const Scene& machine,
             std::span<const ContactEvent> events, const Truth& truth,
             const std::vector<double>& V_replica);

/// V of the replica at the samples.
std::vector<double> follow_replica(const Scene& given, const Scene& machine,
                                   std::span<const ContactEvent> events, const Truth& truth);

struct Row {
  std::string scene;
  EstimatorKind estimator = EstimatorKind::timing;
  Eigen::Index coordinates = 0;
  int contacts = 0;
  double jitter = 0.0, omega_sigma = 0.0;
  double duration = 0.0, tick = 0.0;
  std::size_t events = 0;
  int seeds = 0;
  Summary summary;
  std::vector<std::string> missed;  ///< criteria not met; none for runs with a disturbance
};

/// A row for each jitter and estimator, passed on as soon as it is complete. Throws as simulate(),
/// and std::invalid_argument if Start::machine finds no start outside the supports.
void study(const Scene& scene, const std::vector<double>& jitters,
           const std::vector<EstimatorKind>& estimators, const Options& options,
           const std::function<void(const Row&)>& on_row);

}  // namespace sprag::calibration
