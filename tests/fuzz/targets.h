// Fuzzing targets: every reader of foreign input. A target must return for every input, without an
// exception and within its memory limits. It aborts the process if the reader violates a
// postcondition.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace sprag::fuzz {

using Input = std::span<const std::uint8_t>;

/// LCM packets through the decoder, the sessions, the clock and the time line.
void message(Input input);
/// An LCM log.
void log(Input input);
/// An events CSV.
void events(Input input);
/// A scene file, and a few ticks of its replica.
void scene(Input input);

struct Target {
  const char* name;
  void (*run)(Input);
};

inline constexpr std::array<Target, 4> targets{
    {{"message", message}, {"log", log}, {"events", events}, {"scene", scene}}};

}  // namespace sprag::fuzz
