// Input and output of every method of the comparison. Each method has a file in methods/ (or in
// ../peers/) and a row of the table in methods.cpp.
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
  /// q and u are requested at k sample_step, k = 0, 1, ... (after events); 0: no samples, as in the
  /// timed runs.
  double sample_step = 0.0;

  Eigen::Index samples() const;
  double sample_time(Eigen::Index k) const { return static_cast<double>(k) * sample_step; }
};

/// Result and cost of a run. A failed run keeps the results up to its failure.
struct Outcome {
  /// Times of the impacts, in order: closings of an open contact as the method sees them. For a
  /// time-stepping method this is the end of the step in which an open contact gets an impulse.
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
  const char* name;  ///< as in the charts
  Kind kind;
  const char* knob;  ///< meaning of `settings`: "step [s]", "tolerance", "stiffness [N/m]"
  std::vector<double> settings;
  /// Fills the prepared outcome. Does not throw: a failure is part of the outcome.
  void (*run)(const Task& task, double setting, Outcome& outcome);
};

/// The table.
std::span<const Method> methods();

}  // namespace sprag::work_precision
