// The publishing thread: sends estimates on the bus, writes settled ones to the file, publishes the
// health once a second, and prints messages for the user.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/messages.h"
#include "observer/health.h"
#include "observer/mailboxes.h"
#include "observer/notices.h"
#include "observer/reception.h"
#include "observer/settled_output.h"

namespace sprag {

class Publication {
 public:
  /// `duration`: requested simulated time [s]. All arguments must outlive this.
  Publication(Bus& bus, const Inbox& inbox, Outbox& outbox, Notices& notices,
              SettledOutput& settled, Reception& reception, double duration,
              std::vector<Output> outputs);
  Publication(const Publication&) = delete;
  Publication& operator=(const Publication&) = delete;

  /// Publishes until over() returns true.
  void run(const std::function<bool()>& over);

  /// Publishes the rest after the producers have ended. Repeats the last settled estimate and the
  /// last health message, since nothing follows that would reveal their loss to a listener.
  void finish();

  /// Number of estimates that could not be sent.
  std::int64_t unsent() const { return unsent_; }

 private:
  void empty_outbox();
  void publish(EstimateSample& estimate, bool settled);
  void publish_parameters(const EstimateSample& estimate);
  void publish_health(const ReceptionFigures& reception, bool last);
  template <class Message>
  void send(const char* channel, const Message& message, std::vector<std::uint8_t>& buffer);
  void print(const Announcement& announcement);
  void progress();

  Bus& bus_;
  const Inbox& inbox_;
  Outbox& outbox_;
  Notices& notices_;
  SettledOutput& settled_;
  Reception& reception_;
  double duration_;
  std::vector<Output> outputs_;
  // Reused, so that sending allocates only where a message grows.
  estimate_t estimate_{};
  outputs_t outputs_message_{};
  bounds_t bounds_{};
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> last_outputs_;  // last settled message
  std::vector<std::uint8_t> last_settled_;
  std::vector<std::uint8_t> parameters_;          // last message sent
  double known_ = 0.0, accepted_ = 0.0;           // values in it
  bool from_filter_ = false;                      // value in it
  IntegrationStatus status_;                      // last status received
  EstimateSource source_ = EstimateSource::none;  // source of the last provisional estimate
  std::vector<std::uint8_t> health_;
  std::int64_t unsent_ = 0;
  bool observing_ = false;  // set by the announcement of the first session
  std::int64_t reported_session_ = 0;
};

}  // namespace sprag
