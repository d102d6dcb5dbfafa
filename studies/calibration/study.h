// The calibration study: for a machine and a jitter, many runs of an estimator on the master's
// jittered events, and what its errors are against the standard deviations that it tells.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/filter/track.h"
#include "sprag/detail/replica/any_replica.h"
#include "sprag/scene.h"
#include "studies/calibration/statistics.h"
#include "studies/common/disturbance.h"

namespace sprag::calibration {

/// Where the estimate starts.
enum class Start {
  scene,   ///< where the scene says
  prior,   ///< anew each seed: off the master's start by what the scene's uncertainty says
  machine  ///< where the scene says, and the master off it by that, anew each seed: another path
};

/// What befalls an estimator beside jitter.
enum class Trouble {
  none,
  spurious,  ///< as many more pulses as a tenth of the events
  missing,   ///< a tenth of the events is lost
  mixed,     ///< both
  wrong      ///< one parameter of the model, another each seed, is off by 1 to 5 %
};

struct Options {
  int seeds = 200;        ///< 1, 2, ...; a fifth of them for machines of more than 40 coordinates
  double duration = 0.0;  ///< 0: usual_duration(), but no more than 2500 events
  double tick = 0.0;      ///< 0: a twenty-thousandth of the duration, to one digit
  int samples = 800;      ///< of the errors, in all of the duration
  Start start = Start::scene;
  Trouble trouble = Trouble::none;
  TrackThresholds thresholds;
  int threads = 2;
};

/// A master's run, and its states at sampled ticks.
struct Truth {
  std::vector<ContactEvent> events;
  double duration = 0.0, tick = 0.0;
  std::int64_t stride = 1;  ///< ticks a sample
  Eigen::MatrixXd q, u;     ///< a column each sample, sample 0 at tick `stride`
};

/// Throws SimulationError, or std::invalid_argument for a machine without a usual duration if none
/// is given.
Truth simulate(const Scene& scene, const Options& options);

/// A started estimator through all ticks of `truth`, told the events as they arrive; on_tick(k) at
/// ticks with events, on_sample(sample) at sampled ones.
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

/// One run: `told` is the machine as the estimator knows it, with the jitter and the start that it
/// is told; `events` as they arrive.
Trial follow(EstimatorKind estimator, const TrackThresholds& thresholds, const Scene& told,
             const Scene& machine, std::span<const ContactEvent> events, const Truth& truth,
             const std::vector<double>& V_replica);

/// V of the replica at the samples.
std::vector<double> follow_replica(const Scene& told, const Scene& machine,
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
  std::vector<std::string> missed;  ///< bars; none are held against runs in trouble
};

/// A row for each jitter and estimator, handed out as soon as it is known. Throws as simulate(),
/// and std::invalid_argument where Start::machine finds no start outside the supports.
void study(const Scene& scene, const std::vector<double>& jitters,
           const std::vector<EstimatorKind>& estimators, const Options& options,
           const std::function<void(const Row&)>& on_row);

}  // namespace sprag::calibration
