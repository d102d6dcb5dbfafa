// Recorded inputs against the analytic scene (docs/measurements/recorded_input.md).
#pragma once

namespace sprag::recorded_input {

/// Prints a CSV: errors of the state and of impact times, and CPU time, by samples per period.
void convergence();

/// Prints the master's CPU time with a harmonic and with 2 kHz records, the least of alternating
/// runs.
void speed();

}  // namespace sprag::recorded_input
