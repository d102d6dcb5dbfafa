#include "lcmtypes/estimate_listener.h"

#include <algorithm>
#include <utility>

namespace sprag {

EstimateListener::EstimateListener(EstimateChannel channel, const std::string& url,
                                   const std::optional<Key>& key)
    : bus_(url, key) {
  const char* name = channel == EstimateChannel::now ? estimate_channel : settled_channel;
  bus_.subscribe(name, [this](std::string_view, std::span<const std::uint8_t> data, std::int64_t) {
    estimate_t estimate{};
    if (decode(data, estimate) == Refusal::none) {
      received_.push_back(std::move(estimate));
    } else {
      ++refused_;
    }
  });
}

std::optional<estimate_t> EstimateListener::next(std::chrono::milliseconds timeout) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + timeout;
  while (received_.empty()) {
    // Rounded up, so that the last fraction of a millisecond does not busy-wait.
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now());
    if (bus_.handle(std::max(left, std::chrono::milliseconds(0))) == 0 && Clock::now() >= end) {
      return std::nullopt;
    }
  }
  std::optional<estimate_t> estimate(std::move(received_.front()));
  received_.pop_front();
  return estimate;
}

}  // namespace sprag
