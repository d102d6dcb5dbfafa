// Which run an index is: pure functions of a study and an index, from 0.
#pragma once

#include <cstdint>
#include <vector>

#include "sprag/scene.h"
#include "tools/study/disturbance.h"
#include "tools/study/study_file.h"

namespace sprag::study {

/// index = point * runs + run.
inline std::int64_t point_of(const Study& study, std::int64_t index) { return index / study.runs; }
inline std::int64_t run_of(const Study& study, std::int64_t index) { return index % study.runs; }
/// The number of the streams of random numbers (random.h) that this run draws from.
inline std::uint64_t stream_of(const Study& study, std::int64_t index) {
  return static_cast<std::uint64_t>(study.common_draws ? run_of(study, index) : index);
}

/// The values of the axes, one each.
std::vector<double> values_at(const Study& study, std::int64_t index);

/// What these values make of the study.
struct Setting {
  Scene machine;
  Scene told;  ///< the machine as its observer knows it; maybe in fewer coordinates
  Disturbance disturbance;
  std::optional<double> start_replica;
  double start_machine = 0.0;
  double duration = 0.0, tick = 0.0;
};

/// Throws SceneError where the values make no scene, or ModelError.
Setting setting_of(const Study& study, const std::vector<double>& values);

/// Draws the starts that the study leaves to chance. Throws Error where no start outside the
/// supports is found.
void draw_starts(const Study& study, std::uint64_t stream, Setting& setting);

}  // namespace sprag::study
