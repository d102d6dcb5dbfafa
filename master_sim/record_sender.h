// Sends the samples of a machine's recorded excitation, as a data logger beside the machine would:
// each sample at its own time.
#pragma once

#include <cstdint>

#include "lcmtypes/input_sender.h"
#include "sprag/sampled_input.h"

namespace sprag {

class RecordSender {
 public:
  /// `record` has even samples of an acceleration. `session` is that of the contact messages. `bus`
  /// must outlive this.
  RecordSender(Bus& bus, SampledInputPointer record, std::int64_t session);

  /// Sends the samples up to time t [s], and `ahead` samples after them, in as many messages as
  /// needed, at least one. After the record its last value is repeated.
  void send(double t, int ahead = 0);

  /// Time in which a message's room for new samples is filled [s].
  double stride() const { return InputSender::most_new * record_->spacing(); }

  std::int64_t messages() const { return sender_.messages(); }
  std::int64_t unsent() const { return sender_.unsent(); }  ///< messages that could not be sent

 private:
  SampledInputPointer record_;
  InputSender sender_;
};

}  // namespace sprag
