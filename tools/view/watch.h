// State of the page: collects the messages of a run and returns frames and curves. It follows one
// session, by the same rules as an observer, and clears its data when the next session starts.
// Independent of transport and clock; its memory is bounded.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/messages.h"
#include "recording/arrival.h"
#include "recording/session_tracker.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/events/input_message.h"
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

  /// Messages in order of arrival; arrival times must not decrease. Messages of sessions other than
  /// the followed session count as `of_others`, messages that do not match the scene as `misfits`.
  void take(const ContactMessage& message, const Arrival& arrival);
  void take_estimate(const estimate_t& sample, const Arrival& arrival);
  void take_settled(const estimate_t& sample, const Arrival& arrival);
  void take(const state_t& truth, const Arrival& arrival);
  void take(const outputs_t& sample, const Arrival& arrival);
  /// Half-widths are used only if the last settled estimate received has the same tick: a band
  /// needs both.
  void take(const bounds_t& sample, const Arrival& arrival);
  void take(const parameters_t& sample, const Arrival& arrival);
  void take(const health_t& health, const Arrival& arrival);
  /// Samples of a streamed excitation.
  void take(const InputMessage& message, const Arrival& arrival);

  /// The frame at the monotonic time `now` [ns].
  Frame frame(std::int64_t now) const;

  /// The last health message of an observer, and its arrival [ns].
  const std::optional<health_t>& health() const { return health_; }
  std::int64_t health_arrival() const { return health_arrival_; }

  /// Curves of quantity number `quantity` in a window.
  Curves curves(std::size_t quantity, const Window& window) const;

  /// The quantities with curves: outputs, gaps and, of a machine with few of them, coordinates.
  const std::vector<Quantity>& quantities() const { return quantities_; }
  /// The input that is drawn, with its unit; empty: the scene has no record.
  const std::string& input_label() const { return input_label_; }
  /// The first and the last time of all curves; 0 and 0 if there are no data.
  std::pair<double, double> extent() const;

  const DrawnMachine& machine() const { return machine_; }
  const Scene& scene() const { return scene_; }
  const MessageCounts& messages() const { return tracker_.counts(); }
  std::int64_t of_others() const { return of_others_; }
  std::int64_t misfits() const { return misfits_; }

 private:
  bool follows(std::int64_t session, std::int64_t utime, const Arrival& arrival);
  void begin(std::int64_t session);
  /// Counts a message that does not match the scene.
  bool fits(bool matches) {
    if (!matches) ++misfits_;
    return matches;
  }
  bool ends_with_outputs(const std::vector<std::string>& names, std::size_t others) const;
  void keep_provisional(const estimate_t& sample);
  template <class Message>
  double value_of(const Quantity& quantity, const Message& message) const;
  std::vector<double> estimate_row(const estimate_t& sample) const;
  double penetration_of(const estimate_t& sample) const;
  void add_energy(const SyncRow* row);
  void add_innovation(const estimate_t& sample);
  const estimate_t* shown_estimate() const;
  const state_t* nearest_truth(double t) const;
  bool runs_free(std::int64_t now) const;
  Rows input_in(const Window& window) const;

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
  Raster penetrating_;  // one row: intervals with penetration of the settled estimate
  std::deque<Suspect> suspects_;
  Pairing pairing_;

  History estimates_;    // low, mean and high of each gap and coordinate
  History outputs_;      // low, mean and high of each output
  History guaranteed_;   // low and high guaranteed bound of each quantity
  History truths_;       // the machine's value of each quantity
  History bounds_;       // B
  History energies_;     // V
  History innovations_;  // ratio of ClosingInnovation
  History inputs_;       // samples of a streamed excitation

  SampledInputPointer
      input_;  // the record that is drawn, or that of a streamed excitation; or null
  std::string input_label_;
  bool streamed_ = false;

  // Provisional estimates later than the last settled estimate, by time; for each time the latest.
  std::map<double, estimate_t> provisional_;
  double spacing_ = 0.0;  // least distance of provisional estimates [s]
  std::optional<estimate_t> settled_;
  std::optional<estimate_t> latest_;  // the latest provisional estimate
  std::deque<state_t> truth_;         // the last states of the machine
  std::optional<Energy> energy_;
  std::optional<ClosingInnovation> innovation_;
  std::optional<parameters_t> parameters_;
  std::optional<health_t> health_;
  std::int64_t inconsistencies_ = 0;
  double speed_ = 1.0;  // of the master

  static constexpr std::int64_t never = std::numeric_limits<std::int64_t>::min() / 2;
  std::int64_t contacts_arrival_ = never, estimate_arrival_ = never, truth_arrival_ = never,
               health_arrival_ = never;
  std::int64_t of_others_ = 0, misfits_ = 0;
};

}  // namespace sprag::view
