// Design of a study: pure functions from a study and a run's index (from 0) to the run's settings.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/detail/study/disturbance.h"
#include "sprag/detail/study/study_file.h"
#include "sprag/scene.h"

namespace sprag::study {

/// index = point * runs + run.
inline std::int64_t point_of(const Study& study, std::int64_t index) { return index / study.runs; }
inline std::int64_t run_of(const Study& study, std::int64_t index) { return index % study.runs; }
/// Number of the streams of random numbers (random.h) that this run uses.
inline std::uint64_t stream_of(const Study& study, std::int64_t index) {
  return static_cast<std::uint64_t>(study.common_draws ? run_of(study, index) : index);
}

/// The values of the axes at an index, one for each.
std::vector<double> values_at(const Study& study, std::int64_t index);

/// The settings of a run with these values.
struct Setting {
  Scene machine;
  Scene observer;  ///< the observer's model of the machine, possibly with fewer coordinates
  Disturbance disturbance;
  std::optional<double> start_replica;
  double start_machine = 0.0;
  double duration = 0.0, tick = 0.0;
};

/// Throws SceneError if the values make no valid scene, or ModelError.
Setting setting_of(const Study& study, const std::vector<double>& values);

/// Draws the random starts. Throws Error if no start outside the supports is found.
void draw_starts(const Study& study, std::uint64_t stream, Setting& setting);

}  // namespace sprag::study
