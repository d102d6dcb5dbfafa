#include "lcmtypes/input_sender.h"

#include <algorithm>
#include <iterator>

#include "lcmtypes/wall_clock.h"

namespace sprag {

InputSender::InputSender(Bus& bus, double t0, double dt, std::int64_t session) : bus_(bus) {
  message_.session = session;
  message_.t0 = t0;
  message_.dt = dt;
  message_.channels = 1;
}

void InputSender::add(std::int64_t k, double value) {
  if (k != message_.total) {
    if (pending()) send();
    message_.total = k;
    message_.n = 0;
    std::ranges::fill(message_.value, 0.0);
  }
  if (message_.n == max_input_values) {
    std::shift_left(std::begin(message_.value), std::end(message_.value), 1);
    --message_.n;
  }
  message_.value[message_.n++] = value;
  ++message_.total;
  if (++new_ == most_new) send();
}

void InputSender::send() {
  if (message_.n == 0) return;
  message_.utime = wall_clock_us();
  ++message_.sequence;
  if (!bus_.publish(input_channel, encode(message_, buffer_))) ++unsent_;
  new_ = 0;
}

}  // namespace sprag
