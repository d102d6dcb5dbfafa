#include "lcmtypes/input_sender.h"

#include <algorithm>
#include <cmath>

#include "lcmtypes/wall_clock.h"

namespace sprag {

InputSender::InputSender(Bus& bus, SampledInputPointer record, std::int64_t session)
    : bus_(bus), record_(std::move(record)) {
  message_.session = session;
  message_.t0 = record_->sample_times().front();
  message_.dt = record_->spacing();
}

double InputSender::value(std::int64_t k) const {
  const std::vector<double>& values = record_->sample_values();
  return values[std::min(static_cast<std::size_t>(k), values.size() - 1)];
}

void InputSender::send(double t, int ahead) {
  const double since = (t - record_->settings().delay - message_.t0) / message_.dt;
  // At least the first sample; the rounding of t / dt does not matter.
  const auto until =
      std::max<std::int64_t>(static_cast<std::int64_t>(std::floor(since)) + 1, 1) + ahead;
  do {
    message_.total = std::max(message_.total, std::min(until, message_.total + max_input_values));
    message_.n = static_cast<int>(std::min<std::int64_t>(message_.total, max_input_values));
    for (int i = 0; i < message_.n; ++i) {
      message_.value[static_cast<std::size_t>(i)] = value(message_.first() + i);
    }
    message_.utime = wall_clock_us();
    ++message_.sequence;
    encode(message_, bytes_);
    if (!bus_.publish(input_channel, bytes_)) ++unsent_;
  } while (message_.total < until);
}

double InputSender::stride() const { return 0.5 * max_input_values * message_.dt; }

}  // namespace sprag
