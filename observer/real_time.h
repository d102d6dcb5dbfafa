// Linux facilities for real-time threads.
#pragma once

#include <string>

namespace sprag {

/// Locks all memory, present and future, into RAM. Returns an error message, empty on success.
std::string lock_memory();

/// Runs the calling thread under SCHED_FIFO with this priority, 1 to 99. Returns an error message,
/// empty on success.
std::string schedule_fifo(int priority);

/// Sets the timer slack of the calling thread to its minimum; the default delays wake-ups by up to
/// 50 us.
void sleep_exactly();

}  // namespace sprag
