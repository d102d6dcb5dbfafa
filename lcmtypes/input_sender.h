// Sends the samples of a machine's recorded excitation on SPRAG_INPUT, as a data logger beside the
// machine would: each sample at its own time, and the last ones again in every message.
#pragma once

#include <cstdint>

#include "lcmtypes/bus.h"
#include "lcmtypes/input_codec.h"
#include "sprag/sampled_input.h"

namespace sprag {

class InputSender {
 public:
  /// `record` has even samples of an acceleration. `session` is that of the contact messages. `bus`
  /// must outlive this.
  InputSender(Bus& bus, SampledInputPointer record, std::int64_t session);

  /// Sends the samples up to time t [s], and `ahead` samples after them, in as many messages as
  /// needed, at least one. After the record its last value is repeated.
  void send(double t, int ahead = 0);

  /// Time in which a message's room is filled with new samples by one half [s].
  double stride() const;

  std::int64_t messages() const { return message_.sequence; }
  std::int64_t unsent() const { return unsent_; }  ///< messages that could not be sent

 private:
  double value(std::int64_t k) const;

  Bus& bus_;
  SampledInputPointer record_;
  InputMessage message_;
  EncodedInput bytes_{};
  std::int64_t unsent_ = 0;
};

}  // namespace sprag
