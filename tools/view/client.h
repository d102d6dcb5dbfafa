// One client of the page's stream: its selected window and quantity, and its next message. Every
// message holds the newest data. At most `most_unseen` messages are unacknowledged, so a slow
// client receives fewer messages and delays nobody. Independent of the transport.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/view/frame_text.h"
#include "tools/view/watch.h"

namespace sprag::view {

class Client {
 public:
  /// Takes a message of the client and ignores everything else:
  /// {"seen": n}, {"view": {"window": s, ...}} or {"view": {"from": t, "to": t, ...}}, with
  /// "pixels" and "quantity" in either.
  void receive(std::string_view message);

  /// Whether enough of the messages sent are acknowledged.
  bool wants() const { return sent_ - seen_ < most_unseen; }

  /// The next message. `now`: the time of the watch's messages; `wall`: the time of the viewer; the
  /// two differ in a replay. Both monotonic [ns]. `speed` as in put_scene(); `over`: the replay has
  /// ended.
  std::string next(const Watch& watch, std::optional<double> speed, std::int64_t now,
                   std::int64_t wall, bool over);

 private:
  static constexpr std::int64_t most_unseen = 3;

  bool curves_due(std::pair<double, double> extent, std::int64_t wall) const;
  Window window(std::pair<double, double> extent) const;

  std::int64_t sent_ = 0, seen_ = 0;
  bool follow_ = true;
  double length_ = 20.0;  // of the following window [s]
  double from_ = 0.0, to_ = 1.0;
  int pixels_ = 800;
  std::string quantity_;
  bool changed_ = true;
  std::int64_t curves_sent_ = 0, health_sent_ = 0;  // monotonic [ns]
  double curves_end_ = 0.0;                         // end of the extent when curves were sent last
  std::optional<std::int64_t> session_;
};

}  // namespace sprag::view
