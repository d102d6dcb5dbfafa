// A scene's estimator on its time line, and what it says of a tick as a message: the part that live
// observer and replay share.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "lcmtypes/state_codec.h"
#include "observer/options.h"
#include "sprag/detail/bound/guarantee.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/scene.h"

namespace sprag {

struct Estimation {
  using State = TrackingEstimator::State;

  /// Keeps `history` ticks to go back to. Throws ModelError.
  Estimation(const Scene& scene, const ObserverOptions& options, std::int64_t history);
  Estimation(const Estimation&) = delete;
  Estimation& operator=(const Estimation&) = delete;

  /// With room for all that an estimate holds.
  EstimateSample empty_sample() const;

  /// What there is to say of a tick, but for session, settled tick and time of sending; or without
  /// q, u, deviations and bound, which costs next to nothing. They do not allocate.
  void describe(const State& state, EstimateSample& sample);
  /// Takes note of a settled tick of which only note() is asked; each in order.
  void pass(const State& state);
  void note(const State& state, EstimateSample& sample) const;

  /// Nothing after t is asked for.
  void set_end(double t);

  /// Adds "settled_tick" and "flow_path".
  void to_json(nlohmann::ordered_json& report);

  /// The cause of the last inconsistency, where records before it are known to be lost.
  void name_known_loss(Confidence& confidence) const;

  std::vector<Contact> supports;
  double length;  ///< length_scale() [m]
  int contacts;
  Eigen::Index coordinates;
  double initial_bound;  ///< B(0)
  bool adaptive;         ///< the model is identified while it runs, so that no bound is its own
  TrackingEstimator estimator;
  TimeLine<TrackingEstimator> time_line;
  std::unique_ptr<Guarantee> guarantee;  ///< null without tolerances, or without a replica
};

}  // namespace sprag
