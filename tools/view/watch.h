// What an audience knows of a run: made of the messages on the bus, and asked for what there is to
// show. It follows one master, as an observer does, and begins anew with the next. A pure core: it
// knows neither transport nor a clock; its memory does not grow.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/bounds_codec.h"
#include "lcmtypes/health_codec.h"
#include "lcmtypes/outputs_codec.h"
#include "lcmtypes/parameters_codec.h"
#include "lcmtypes/state_codec.h"
#include "recording/arrival.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/scene.h"
#include "tools/sync_logger/logger.h"
#include "tools/view/drawn_machine.h"
#include "tools/view/frame.h"
#include "tools/view/history.h"
#include "tools/view/raster.h"

namespace sprag::view {

class Watch {
 public:
  /// Throws ModelError.
  explicit Watch(const Scene& scene, Freshness freshness = Freshness::any);

  /// What came, in the order in which it did; arrivals do not go back. Messages of other sessions
  /// than the one that is followed count as `of_others`, those that do not fit the scene as
  /// `misfits`.
  void take(const ContactMessage& message, const Arrival& arrival);
  void take_estimate(const EstimateSample& sample, const Arrival& arrival);
  void take_settled(const EstimateSample& sample, const Arrival& arrival);
  void take_truth(const StateSample& sample, const Arrival& arrival);
  void take(const OutputsSample& sample, const Arrival& arrival);
  /// Half-widths count only for the settled estimate of the same tick, which must have come before:
  /// a band needs both.
  void take(const BoundsSample& sample, const Arrival& arrival);
  void take(const ParametersSample& sample, const Arrival& arrival);
  void take(const Health& health, const Arrival& arrival);

  /// At this monotonic time [ns].
  Frame frame(std::int64_t now) const;

  /// The last health of an observer, and when it came [ns].
  const std::optional<Health>& health() const { return health_; }
  std::int64_t health_arrival() const { return health_arrival_; }

  /// Curves of quantity number `quantity` in a window.
  Curves curves(std::size_t quantity, const Window& window) const;

  /// What has a curve: outputs, gaps, and the coordinates of a machine of few.
  const std::vector<Quantity>& quantities() const { return quantities_; }
  /// The first and the last time of all curves; nothing yet: 0 and 0.
  std::pair<double, double> extent() const;

  const DrawnMachine& machine() const { return machine_; }
  const Scene& scene() const { return scene_; }
  const MessageCounts& messages() const { return tracker_.counts(); }
  std::int64_t of_others() const { return of_others_; }
  std::int64_t misfits() const { return misfits_; }

 private:
  bool follows(std::int64_t session, std::int64_t utime, const Arrival& arrival);
  void begin(std::int64_t session);
  bool fits(const StateSample& sample, bool whole);
  void note(const EstimateSample& sample, const Arrival& arrival);
  void keep_provisional(const EstimateSample& sample);
  double value_of(const Quantity& quantity, const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                  double t) const;
  void add_outputs(double t, std::span<const double> values, std::span<const double> sigmas);
  void add_guaranteed(const EstimateSample& sample, const Confidence& half_widths);
  std::vector<double> estimate_row(const EstimateSample& sample) const;
  double penetration_of(const EstimateSample& sample) const;
  void add_energy(const SyncRow* row);
  const EstimateSample* shown_estimate() const;
  const StateSample* nearest_truth(double t) const;
  bool runs_free(std::int64_t now) const;

  Scene scene_;
  DrawnMachine machine_;
  std::vector<Quantity> quantities_;
  Eigen::Index f_;
  double length_;  // length_scale() [m]

  SessionTracker tracker_;
  FreshnessRule freshness_;
  std::optional<std::int64_t> session_;
  EventHistory events_;
  Raster raster_;
  Raster penetrating_;  // one row: when the settled estimate was inside a support
  std::deque<Suspect> suspects_;
  Pairing pairing_;

  History estimates_;   // low, mean and high of each quantity that is no output
  History outputs_;     // and of each output
  History guaranteed_;  // low and high of each quantity, between which the machine is proven to be
  History truths_;      // of each quantity
  History bounds_;      // B
  History energies_;    // V

  // Estimates for now behind the last settled one, by their time: the last word on a tick counts.
  std::map<double, EstimateSample> provisional_;
  double spacing_ = 0.0;  // that they keep at least
  std::optional<EstimateSample> settled_;
  std::optional<EstimateSample> latest_;  // for now
  std::deque<StateSample> truth_;         // the last ones
  std::optional<Energy> energy_;
  std::optional<ParametersSample> parameters_;
  std::optional<Health> health_;
  std::int64_t inconsistencies_ = 0;
  double speed_ = 1.0;  // of the master

  static constexpr std::int64_t never = std::numeric_limits<std::int64_t>::min() / 2;
  std::int64_t contacts_arrival_ = never, estimate_arrival_ = never, truth_arrival_ = never,
               health_arrival_ = never;
  std::int64_t of_others_ = 0, misfits_ = 0;
};

}  // namespace sprag::view
