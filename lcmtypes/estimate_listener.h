// Receives the estimates of observers on the bus: provisional ones (SPRAG_ESTIMATE), or settled
// ones in order (SPRAG_SETTLED).
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "lcmtypes/bus.h"
#include "lcmtypes/messages.h"

namespace sprag {

enum class EstimateChannel { now, settled };

class EstimateListener {
 public:
  /// Throws BusError or UrlError.
  explicit EstimateListener(EstimateChannel channel, const std::string& url = default_url,
                            const std::optional<Key>& key = std::nullopt);
  EstimateListener(const EstimateListener&) = delete;
  EstimateListener& operator=(const EstimateListener&) = delete;

  /// The next estimate of any observer on the channel; waits for it up to `timeout`. Throws
  /// BusError.
  std::optional<estimate_t> next(std::chrono::milliseconds timeout);

  /// Number of messages that were malformed or not signed with the key.
  std::int64_t refused() const { return refused_ + bus_.counts().unauthenticated; }

 private:
  Bus bus_;
  std::deque<estimate_t> received_;
  std::int64_t refused_ = 0;
};

}  // namespace sprag
