// What Linux offers a thread that must not be late.
#pragma once

#include <string>

namespace sprag {

/// Locks all memory, present and future, into RAM. Returns what failed, or nothing.
std::string lock_memory();

/// Runs the calling thread under SCHED_FIFO with this priority, 1 to 99. Returns what failed, or
/// nothing.
std::string schedule_fifo(int priority);

/// Wakes the calling thread as close to its time as the timers go, not up to 50 us later.
void sleep_exactly();

}  // namespace sprag
