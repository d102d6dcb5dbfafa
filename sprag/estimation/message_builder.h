// Turns a master's events into the reports it sends: numbered, the last records in every one.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "sprag/estimation/contact_report.h"
#include "sprag/mechanics/contact_event.h"

namespace sprag {

class ReportBuilder {
 public:
  /// `session`: random per master start; `speed`: simulated s per wall s, infinite if unpaced.
  ReportBuilder(std::int64_t session, double speed, int contacts);

  /// Takes events that have happened, in order.
  void add(std::span<const ContactEvent> events);

  /// Whether a report has to go out before its heartbeat is due.
  bool pending() const { return sent_ < records_.size(); }

  /// The next report: everything up to `horizon`, or, when that does not fit, as much as does;
  /// pending() then stays true. `utime` is the wall clock at send [us].
  const ContactReport& next(double horizon, std::int64_t utime);

  std::int64_t session() const { return report_.session; }
  std::int64_t sent() const { return report_.sequence; }

 private:
  ContactReport report_;
  std::deque<ContactEvent> records_;  // the last ones, sent and not yet sent
  std::size_t sent_ = 0;              // how many of records_ have been sent
};

}  // namespace sprag
