// A scene's estimator with its time line, and the description of a tick as a message. Used by the
// live observer and by the replay.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "observer/estimate_sample.h"
#include "observer/input_stream.h"
#include "observer/options.h"
#include "sprag/detail/bound/guarantee.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/scene.h"

namespace sprag {

struct Estimation {
  using State = TrackingEstimator::State;

  /// Keeps `history` ticks for rollbacks. Throws ModelError.
  /// Throws UsageError if the scene's excitation is streamed and the options do not allow it.
  Estimation(const Scene& scene, const ObserverOptions& options, std::int64_t history);
  Estimation(const Estimation&) = delete;
  Estimation& operator=(const Estimation&) = delete;

  /// A sample with all vectors allocated.
  EstimateSample empty_sample() const;

  /// Fills `sample` from a tick, except session, settled tick and time of sending. describe() fills
  /// everything; note() omits q, u, standard deviations and bound and is cheap. They do not
  /// allocate. `settled`: the tick is handed out as final; these ticks come in order. A guarantee
  /// covers settled ticks only.
  void describe(const State& state, bool settled, EstimateSample& sample);
  /// Updates the guarantee at a settled tick for which only note() is called. Ticks come in order.
  void pass(const State& state);
  void note(const State& state, EstimateSample& sample) const;

  /// Starts from the first message of a session.
  void restart(const ContactMessage& message);
  /// Takes a message that continues the session, or resumes it after a jump of the machine's clock
  /// or counts. True: the time line has restarted, since the streamed input begins late, after a
  /// long gap, or after a jump.
  bool receive(const ContactMessage& message, bool resumes);

  /// Sets the end of the run: no tick after t will be requested.
  void set_end(double t);

  /// Adds "settled_tick" and "flow_path".
  void to_json(nlohmann::ordered_json& report);

  /// Sets the cause of the last gate failure if records before it are known to be lost.
  void name_known_loss(Confidence& confidence) const;

  StreamedScene of;
  std::vector<Contact> supports;
  double length;  ///< length_scale() [m]
  int contacts;
  Eigen::Index coordinates;
  double
      initial_bound;  ///< B(0); infinite for `adaptive`, whose machine may differ from the scene's
  TrackingEstimator estimator;
  TimeLine time_line;
  std::unique_ptr<InputStream> stream;   ///< null: the excitation is not streamed
  std::unique_ptr<Guarantee> guarantee;  ///< null if no bound holds
};

}  // namespace sprag
