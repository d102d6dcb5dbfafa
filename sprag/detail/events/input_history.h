// Samples of a streamed input in the order of their numbers, from messages that may be lost,
// doubled or out of order. Each sample is taken once. Does not allocate.
#pragma once

#include <cstdint>

#include "sprag/detail/events/input_message.h"
#include "sprag/sampled_input.h"

namespace sprag {

struct InputCounts {
  std::int64_t messages = 0;  ///< of the followed session
  std::int64_t refused = 0;   ///< of another interval or another begin than the first one, or of
                              ///< an interval that is not the record's
  std::int64_t samples = 0;   ///< received
  std::int64_t gaps = 0;      ///< losses that later messages did not repair
  std::int64_t filled = 0;    ///< samples that were interpolated in the gaps
  std::int64_t no_room = 0;   ///< samples after the input's capacity was exhausted
};

class InputHistory {
 public:
  /// Result of a message: new samples are in the input after `from`.
  struct Taken {
    bool any = false;        ///< the message had a new sample
    double from = 0.0;       ///< time of the last sample before, or of the first one [s]
    double gap_from = -1.0;  ///< begin of a gap that was interpolated; -1: none [s]
    double gap_to = -1.0;    ///< and its end [s]
  };

  /// `input` must outlive this, and has no sample yet.
  explicit InputHistory(SampledInput& input) : input_(&input), of_record_(input.spacing()) {}

  /// Forgets all samples: another session begins.
  void restart();

  /// Takes the new samples of a message.
  Taken take(const InputMessage& message);

  bool started() const { return input_->appended() > 0; }
  /// Time of the newest sample; meaningful if started() [s].
  double newest() const { return input_->last(); }
  const SampledInput& input() const { return *input_; }
  const InputCounts& counts() const { return counts_; }

 private:
  bool append(double value);

  SampledInput* input_;
  double of_record_;       // interval between samples of the record [s]
  std::int64_t next_ = 0;  // number of the next sample
  double t0_ = 0.0;        // of the session
  double last_ = 0.0;      // value of sample next_ - 1
  InputCounts counts_;
};

}  // namespace sprag
