// What every method of the comparison takes and gives. One method is one file in methods/ (or in
// ../peers/) and one row of the table in methods.cpp.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sprag/model.h"

namespace sprag::work_precision {

/// Simulate `model` from `start` at t = 0 up to and including `horizon` [s].
struct Task {
  Model model;
  State start;
  double horizon = 0.0;
  /// q and u are wanted at k sample_step, k = 0, 1, ... (post-event), or not at all if 0: time is
  /// measured without.
  double sample_step = 0.0;

  Eigen::Index samples() const;
  double sample_time(Eigen::Index k) const { return static_cast<double>(k) * sample_step; }
};

/// What a run found and what it took. Whatever was reached stays when a run fails.
struct Outcome {
  /// Times of the impacts, in order: closings of a contact that was open, as the method sees them
  /// (a time-stepping method: the end of the step in which a contact that was open gets an
  /// impulse).
  std::vector<double> impacts;
  /// f x samples(); columns that were not reached are NaN.
  Eigen::MatrixXd q, u;
  std::int64_t steps = 0;             ///< time steps taken (exact methods: event intervals)
  std::int64_t solves = 0;            ///< linear or complementarity problems solved
  std::int64_t right_hand_sides = 0;  ///< evaluations of the equation of motion (or of the gap)
  std::string failure;                ///< empty if the horizon was reached
};

/// Sizes q and u for the task, NaN throughout.
void prepare(const Task& task, Outcome& outcome);

enum class Kind { ours, rival, peer };

struct Method {
  const char* name;  ///< as written in the charts
  Kind kind;
  int order;         ///< nominal order in free flight; 0: exact
  const char* knob;  ///< what `settings` are: "step [s]", "tolerance", "stiffness [N/m]"
  std::vector<double> settings;
  const char* abilities;  ///< one line: what it can and cannot do
  /// Fills outcome, which is prepared. Does not throw: a failure is part of the outcome.
  void (*run)(const Task& task, double setting, Outcome& outcome);
};

/// The table.
std::span<const Method> methods();

}  // namespace sprag::work_precision
