// Decodes messages from the bus or from a recording and passes them to the watch.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "lcmtypes/refusal.h"
#include "recording/arrival.h"
#include "tools/view/stage.h"

namespace sprag::view {

/// The channels that take() decodes.
std::span<const char* const> watched_channels();

class Reception {
 public:
  /// Times of contact messages are on `clock`; the watch takes the machine's time.
  Reception(Stage& stage, const ContactClock& clock) : stage_(stage), clock_(clock) {}

  /// Takes a message of a channel; ignores channels outside watched_channels().
  void take(std::string_view channel, std::span<const std::uint8_t> data, const Arrival& arrival);

  std::int64_t messages() const { return messages_; }
  /// Number of messages for each value of Refusal.
  const std::array<std::int64_t, refusal_kinds>& refused() const { return refused_; }

 private:
  template <class Message, class Take>
  void decoded(std::span<const std::uint8_t> data, Message& message, Take take);

  Stage& stage_;
  ContactClock clock_;
  std::int64_t messages_ = 0;
  std::array<std::int64_t, refusal_kinds> refused_{};
  ContactMessage contacts_;
  estimate_t estimate_{};
  state_t state_{};
  outputs_t outputs_{};
  bounds_t bounds_{};
  parameters_t parameters_{};
  health_t health_{};
  InputMessage input_;
};

}  // namespace sprag::view
