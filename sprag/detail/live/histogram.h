// Histogram with buckets of 1/16 of their value: quantiles of long runs within 7 %, without stored
// samples. Does not allocate.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace sprag {

class Histogram {
 public:
  /// Negative values count as 0.
  void add(std::int64_t value) {
    value = std::max<std::int64_t>(value, 0);
    ++buckets_[bucket_of(value)];
    ++count_;
    largest_ = std::max(largest_, value);
  }

  std::int64_t count() const { return count_; }
  std::int64_t largest() const { return largest_; }

  /// Number of values in buckets above that of `value`.
  std::int64_t count_above(std::int64_t value) const {
    std::int64_t above = 0;
    for (std::size_t i = bucket_of(std::max<std::int64_t>(value, 0)) + 1; i < buckets_.size();
         ++i) {
      above += buckets_[i];
    }
    return above;
  }

  /// Value that a share `p` in [0, 1] of all values does not exceed; 0 for an empty histogram.
  std::int64_t quantile(double p) const {
    const double wanted = p * static_cast<double>(count_);
    std::int64_t below = 0;
    for (std::size_t i = 0; i < buckets_.size(); ++i) {
      below += buckets_[i];
      if (below > 0 && static_cast<double>(below) >= wanted) return std::min(last_of(i), largest_);
    }
    return largest_;
  }

 private:
  // One bucket for each value up to 15, then 16 buckets for each power of two.
  static std::size_t bucket_of(std::int64_t value) {
    const auto bits = static_cast<std::uint64_t>(value);
    if (bits < 16) return static_cast<std::size_t>(bits);
    const auto shift = static_cast<unsigned>(std::bit_width(bits)) - 5U;
    return std::size_t{shift} * 16 + static_cast<std::size_t>(bits >> shift);
  }
  static std::int64_t last_of(std::size_t bucket) {
    if (bucket < 32) return static_cast<std::int64_t>(bucket);
    const std::size_t shift = bucket / 16 - 1;
    const std::uint64_t leading = bucket % 16 + 16;
    return static_cast<std::int64_t>(((leading + 1) << shift) - 1);
  }

  std::array<std::int64_t, 976> buckets_{};
  std::int64_t count_ = 0;
  std::int64_t largest_ = 0;
};

}  // namespace sprag
