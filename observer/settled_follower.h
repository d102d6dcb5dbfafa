// Computes impacts and predictions of a live observer in a thread of its own, because they allocate
// and a prediction takes milliseconds. It receives the settled events and follows them with an
// estimator and a time line of its own, like a replay, so its results have the bits of the replay.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/bus.h"
#include "observer/options.h"
#include "observer/spsc_queue.h"
#include "observer/wake.h"
#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/files/impacts_file.h"
#include "sprag/detail/files/predictions_file.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/scene.h"

namespace sprag {

/// An item from the integrating thread. A start, its events and its horizons come in order.
struct Settled {
  enum class Kind : std::int8_t {
    start,   ///< the time line has started at this tick, with these contacts closed
    event,   ///< an event of the time line
    horizon  ///< every event up to this time has been handed over
  };
  Kind kind = Kind::horizon;
  std::int64_t tick = 0;
  std::int64_t session = 0;
  ContactSet chi = 0;
  ContactEvent event{};
  double horizon = 0.0;  ///< [s]
};

class SettledFollower {
 public:
  /// Throws ModelError, or std::runtime_error if a file cannot be written. `bus` must outlive this.
  SettledFollower(const Scene& scene, const ObserverOptions& options, Bus& bus);
  SettledFollower(const SettledFollower&) = delete;
  SettledFollower& operator=(const SettledFollower&) = delete;

  /// To be called by the loop; neither blocks nor allocates. False: the queue is full, try again.
  bool put(const Settled& item);

  /// Runs until stop().
  void run();
  void stop();
  /// Processes the rest; to be called after run().
  void finish();

  /// Throws std::runtime_error if a file could not be written completely.
  void close();

 private:
  void take_all();
  void take(const Settled& item);
  void settle(double horizon);
  void predict();
  void write_impacts();

  static constexpr std::size_t slots = 1U << 14U;

  std::int64_t last_;
  TrackingEstimator estimator_;
  TimeLine time_line_;
  std::int64_t session_ = 0;
  std::vector<ImpactRecord> impacts_;
  std::optional<ImpactsWriter> writer_;
  std::optional<Predictor> predictor_;  // with --predict
  double ahead_;                        // horizon of the prediction [s]
  bool prediction_due_ = false;         // an event has settled since the last prediction
  std::optional<PredictionsWriter> predictions_;
  Bus& bus_;
  std::vector<std::uint8_t> buffer_;
  SpscQueue<Settled> queue_{slots, Settled{}};
  Wake ready_;
  std::atomic<bool> stop_{false};
};

}  // namespace sprag
