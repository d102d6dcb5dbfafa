// Measures one method at one setting on one scene in a child process. A crash, an exit or a hang
// costs only its own row, and each method starts with the same memory state.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "studies/work_precision/matching.h"
#include "studies/work_precision/method.h"

namespace sprag::work_precision {

struct Limits {
  double timeout = 60.0;  ///< of the child, wall clock [s]
  double timing = 0.3;    ///< CPU time to spend on repeats [s]
  int least_repeats = 3;  ///< unless they take longer than a third of the timeout
  int most_repeats = 200;
  double timed_span = 0.0;   ///< the timed runs cover the longer of this and the horizon [s]
  double fine_step = 0.01;   ///< of the samples for the penetration [s]
  bool (*stop)() = nullptr;  ///< asked when a signal arrives: true ends the child
};

/// Parameter figures are NaN.
struct Figures {
  ImpactScore impacts, early_impacts;  ///< up to the reference's horizon, and its `early`
  StateScore states, early_states;
  double penetration = not_known;      ///< [m]
  double cpu_us_per_time = not_known;  ///< shortest CPU time of the repeats [us] / their span [s]
  double memory_kb = not_known;        ///< peak that the first run adds, without code [kB]
  std::int64_t steps = 0;              ///< of the last run, as the next two
  std::int64_t solves = 0;
  std::int64_t right_hand_sides = 0;
};

struct Measurement {
  Figures figures;
  std::string failure;  ///< empty if every run reached its end; else the first reason
};

/// Runs the method from `start` up to the reference's horizon: once with the reference's samples,
/// which also measures its memory, once with fine samples, then repeatedly without samples for the
/// time and the counts. After a failure the earlier figures remain. Throws std::system_error if no
/// process can be started.
Measurement measure(const Method& method, double setting, const Model& model, const State& start,
                    const Reference& reference, const Limits& limits = {});

}  // namespace sprag::work_precision
