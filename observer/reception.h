// The receiving thread: messages of contacts, decoded and told apart by whom they come from.
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
  /// Subscribes to the machine's contacts, `contacts` of them. Everything must outlive this.
  Reception(Bus& bus, int contacts, Inbox& inbox, Notices& notices);
  Reception(const Reception&) = delete;
  Reception& operator=(const Reception&) = delete;

  /// Receives until `stop`. Throws BusError.
  void run(const std::atomic<bool>& stop);

  /// The figures, at most some 50 ms old; for one other thread.
  const ReceptionFigures& told();

  /// After run().
  ReceptionFigures figures() const;

 private:
  void hear(std::span<const std::uint8_t> data, std::int64_t utime);
  void tell_refused();
  void tell_figures();
  bool tell_rise(Notice notice, std::int64_t count);

  Bus& bus_;
  int contacts_;
  Inbox& inbox_;
  Notices& notices_;
  ReceptionFigures figures_;
  SpscQueue<ReceptionFigures> telling_{2, ReceptionFigures{}};
  ReceptionFigures last_put_;  // into it
  ReceptionFigures told_;      // the other thread's
  std::int64_t kernel_drops_ = 0;
  std::array<std::int64_t, notice_kinds> kept_away_{};  // by Notice
};

}  // namespace sprag
