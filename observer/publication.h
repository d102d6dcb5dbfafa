// The publishing thread: estimates to the bus, settled ones to the file as well, how the observer
// fares, and what there is to tell people.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "lcmtypes/bus.h"
#include "observer/health.h"
#include "observer/mailboxes.h"
#include "observer/notices.h"
#include "observer/reception.h"
#include "observer/settled_output.h"

namespace sprag {

class Publication {
 public:
  /// `duration`: simulated time that is asked for [s]. Everything must outlive this.
  Publication(Bus& bus, const Inbox& inbox, Outbox& outbox, Notices& notices,
              SettledOutput& settled, Reception& reception, double duration,
              std::vector<Output> outputs);
  Publication(const Publication&) = delete;
  Publication& operator=(const Publication&) = delete;

  /// Publishes until `over()`.
  void run(const std::function<bool()>& over);

  /// What is left, when nobody produces any more. Repeats the last settled estimate and the last
  /// health: nothing follows that would tell a listener that it missed the end.
  void finish();

  /// Estimates that could not be sent.
  std::int64_t unsent() const { return unsent_; }

 private:
  void empty_outbox();
  void publish(EstimateSample& estimate, bool settled);
  void publish_parameters(const EstimateSample& estimate);
  void publish_health(const ReceptionFigures& reception, bool last);
  void publish_outputs(const EstimateSample& estimate, bool settled);
  void tell(const Announcement& announcement);
  void progress();

  Bus& bus_;
  const Inbox& inbox_;
  Outbox& outbox_;
  Notices& notices_;
  SettledOutput& settled_;
  Reception& reception_;
  double duration_;
  std::vector<Output> outputs_;
  std::vector<std::uint8_t> buffer_;
  std::vector<std::uint8_t> last_outputs_;  // settled
  std::vector<std::uint8_t> last_settled_;
  std::vector<std::uint8_t> parameters_;  // the last that were sent
  double known_ = 0.0, accepted_ = 0.0;   // of these
  bool from_filter_ = false;
  IntegrationStatus status_;  // the last one
  Health::Estimate whose_ = Health::Estimate::none;
  std::vector<std::uint8_t> health_;
  std::int64_t unsent_ = 0;
  bool observing_ = false;
  std::int64_t reported_session_ = 0;
};

}  // namespace sprag
