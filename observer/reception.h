// The receiving thread: decodes contact messages and sorts them by sender into two queues.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>

#include "lcmtypes/bus.h"
#include "observer/figures.h"
#include "observer/mailboxes.h"
#include "observer/notices.h"
#include "observer/spsc_queue.h"

namespace sprag {

class Reception {
 public:
  /// Subscribes to the messages of a machine with `contacts` contacts, whose times are on `clock`,
  /// and to those of its input if `streamed`; the queues have the machine's time. All arguments but
  /// the clock must outlive this.
  Reception(Bus& bus, int contacts, const ContactClock& clock, bool streamed, Inbox& inbox,
            Notices& notices);
  Reception(const Reception&) = delete;
  Reception& operator=(const Reception&) = delete;

  /// Receives until `stop`. Throws BusError.
  void run(const std::atomic<bool>& stop);

  /// The figures, at most about 50 ms old; may be called by one other thread.
  const ReceptionFigures& reported();

  /// The final figures; valid after run().
  ReceptionFigures figures() const;

 private:
  void receive(std::span<const std::uint8_t> data, std::int64_t utime);
  void receive_input(std::span<const std::uint8_t> data, std::int64_t utime);
  void raise_refused();
  void hand_over_figures();
  bool raise_increase(Notice notice, std::int64_t count);

  Bus& bus_;
  int contacts_;
  ContactClock clock_;
  Inbox& inbox_;
  Notices& notices_;
  ReceptionFigures figures_;
  SpscQueue<ReceptionFigures> figures_queue_{2, ReceptionFigures{}};
  ReceptionFigures last_put_;  // last entry of the queue
  ReceptionFigures reported_;  // used by the other thread
  std::int64_t kernel_drops_ = 0;
  std::array<std::int64_t, notice_kinds> kept_away_{};  // discarded by the bus, by Notice
};

}  // namespace sprag
