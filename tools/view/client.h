// One client of the page's stream: what it looks at, and what it is sent next. It gets the newest
// there is, and nothing more until it has said that it has seen some of it; so a slow one is sent
// less, and nothing waits for it. Knows no transport.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tools/view/frame_text.h"
#include "tools/view/watch.h"

namespace sprag::view {

class Client {
 public:
  /// Takes a message of the client; what is none is left alone:
  /// {"seen": n}, {"view": {"follow": true, "window": s, ...}} or {"view": {"from": t, "to": t,
  /// ...}}, with "pixels" and "quantity" in either.
  void hear(std::string_view message);

  /// Whether it has seen enough of what was sent before.
  bool wants() const { return sent_ - seen_ < most_unseen; }

  /// The next message. `now`: the time of the watch's messages; `wall`: that of whoever looks on;
  /// they differ in a replay. Both monotonic [ns]. `speed` as put_scene() has it; `over`: nothing
  /// more will come.
  std::string next(const Watch& watch, std::optional<double> speed, std::int64_t now,
                   std::int64_t wall, bool over);

 private:
  static constexpr std::int64_t most_unseen = 3;

  bool curves_due(std::pair<double, double> extent, std::int64_t wall) const;
  Window window(std::pair<double, double> extent) const;

  std::int64_t sent_ = 0, seen_ = 0;
  bool follow_ = true;
  double length_ = 20.0;  // of the window that follows
  double from_ = 0.0, to_ = 1.0;
  int pixels_ = 800;
  std::string quantity_;
  bool changed_ = true;
  std::int64_t curves_sent_ = 0, health_sent_ = 0;  // when
  double curves_end_ = 0.0;                         // last time that there was then
  std::optional<std::int64_t> session_;
};

}  // namespace sprag::view
