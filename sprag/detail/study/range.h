// Ranges of runs of a study by their index.
#pragma once

#include <cstdint>

namespace sprag::study {

/// Indices first, ..., end - 1.
struct Range {
  std::int64_t first = 0, end = 0;

  std::int64_t size() const { return end - first; }
  friend bool operator==(const Range&, const Range&) = default;
};

/// Number of computed runs, and how many of them failed.
struct Computed {
  std::int64_t runs = 0, failures = 0;
};

}  // namespace sprag::study
