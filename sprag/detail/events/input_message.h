// Content of a message on SPRAG_INPUT: the last samples of a machine's excitation. Each message
// repeats the last samples, so that it repairs lost messages before it.
#pragma once

#include <array>
#include <cstdint>

namespace sprag {

inline constexpr int max_input_values = 150;
inline constexpr int max_input_channels = 8;

struct InputMessage {
  std::int64_t session = 0;   ///< the master's
  std::int64_t sequence = 0;  ///< message number within the session
  std::int64_t utime = 0;     ///< wall clock at send [us]
  double t0 = 0.0;            ///< time of sample 0 [s]
  double dt = 0.0;            ///< interval between samples [s]
  std::int64_t total = 0;     ///< samples of each channel so far
  int channels = 1;
  int n = 0;  ///< samples of each channel in this message, the last ones of `total`
  std::array<double, max_input_values> value{};  ///< sample by sample

  /// Number of the first sample in this message.
  std::int64_t first() const { return total - n; }
  /// Channel 0 of sample number k.
  double sample(std::int64_t k) const {
    return value[static_cast<std::size_t>((k - first()) * channels)];
  }
};

}  // namespace sprag
