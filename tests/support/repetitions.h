// Repetitions of randomized tests: a sanitized build is slower and repeats less.
#pragma once

#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SPRAG_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(undefined_behavior_sanitizer)
#define SPRAG_SANITIZED 1
#endif
#endif

namespace sprag {

#if defined(SPRAG_SANITIZED)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

constexpr int repetitions(int count) { return sanitized ? (count + 19) / 20 : count; }

/// Whether all repetitions run: with `scripts/test --thorough`, not in a sanitized build.
inline bool thorough() { return !sanitized && std::getenv("SPRAG_THOROUGH") != nullptr; }

/// For the longest tests: a quarter of `count`, or all of it if the environment variable
/// SPRAG_THOROUGH is set, as `scripts/test --thorough` does.
inline int long_repetitions(int count) {
  static const bool thorough = std::getenv("SPRAG_THOROUGH") != nullptr;
  return repetitions(thorough ? count : (count + 3) / 4);
}

}  // namespace sprag
