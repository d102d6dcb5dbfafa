#include "lcmtypes/contact_sender.h"

#include <random>

#include "lcmtypes/wall_clock.h"

namespace sprag {
namespace {

std::int64_t random_session() {
  std::random_device device;
  const std::uint64_t high = device();
  const std::uint64_t low = device();
  return static_cast<std::int64_t>(((high << 32U) | low) >> 1U);
}

}  // namespace

ContactSender::ContactSender(Bus& bus, int contacts, double speed)
    : bus_(bus), builder_(random_session(), speed, contacts) {}

void ContactSender::send(double horizon) {
  do {
    const auto message = encode(builder_.next(horizon, wall_clock_us()), buffer_);
    if (!bus_.publish(contacts_channel, message)) ++unsent_;
  } while (builder_.pending());
  next_ = Clock::now() + heartbeat;
}

}  // namespace sprag
