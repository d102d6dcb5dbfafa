#include "lcmtypes/input_sender.h"

#include <algorithm>

#include "lcmtypes/wall_clock.h"

namespace sprag {

InputSender::InputSender(Bus& bus, double t0, double dt, std::int64_t session) : bus_(bus) {
  message_.session = session;
  message_.t0 = t0;
  message_.dt = dt;
}

void InputSender::add(std::int64_t k, double value) {
  if (k != message_.total) {
    if (pending()) send();
    message_.total = k;
    message_.n = 0;
  }
  auto& values = message_.value;
  if (message_.n == max_input_values) {
    std::shift_left(values.begin(), values.end(), 1);
    --message_.n;
  }
  values[static_cast<std::size_t>(message_.n++)] = value;
  ++message_.total;
  if (++new_ == most_new) send();
}

void InputSender::send() {
  if (message_.n == 0) return;
  message_.utime = wall_clock_us();
  ++message_.sequence;
  encode(message_, bytes_);
  if (!bus_.publish(input_channel, bytes_)) ++unsent_;
  new_ = 0;
}

}  // namespace sprag
