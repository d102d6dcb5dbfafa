// Sends the samples of a machine's excitation on SPRAG_INPUT, the last ones again in every message.
#pragma once

#include <cstdint>
#include <vector>

#include "lcmtypes/bus.h"
#include "lcmtypes/messages.h"
#include "sprag/detail/events/input_message.h"

namespace sprag {

class InputSender {
 public:
  /// New samples that a message has at most, so that each sample is in two messages at least.
  static constexpr int most_new = max_input_values / 2;

  /// Sample k has the time t0 + k dt. `session` is that of the contact messages. `bus` must outlive
  /// this.
  InputSender(Bus& bus, double t0, double dt, std::int64_t session);

  /// Adds sample k, later than all before; sends messages whenever their room for new samples is
  /// filled. Numbers that are left out are a gap: messages after it have only the samples after it,
  /// so that an observer treats the missing ones as lost.
  void add(std::int64_t k, double value);

  /// Whether samples have been added that are not sent.
  bool pending() const { return new_ > 0; }

  /// Sends the last samples; nothing before the first sample.
  void send();

  std::int64_t total() const { return message_.total; }  ///< number after the last sample's
  std::int64_t messages() const { return message_.sequence; }
  std::int64_t unsent() const { return unsent_; }  ///< messages that could not be sent

 private:
  Bus& bus_;
  input_t message_{};
  std::vector<std::uint8_t> buffer_;
  int new_ = 0;  // samples at the end of the message that are not sent
  std::int64_t unsent_ = 0;
};

}  // namespace sprag
