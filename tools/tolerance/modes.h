// Number of modes that an observer needs. The full machine gives the events. Estimators with its
// first modes alone follow them, without and with the correction for the other modes that the
// events select (sprag/detail/analysis/reduction_choice.h).
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/tolerance/search.h"

namespace sprag::tolerance {

struct FewerModes {
  int modes = 0;
  /// Of each estimator: root mean square error of the observed quantity [m] in the second half of a
  /// run. This is the tip of a beam, or else the gap at each contact. Infinite if the observer does
  /// not exist.
  std::vector<Spread> plain, corrected;
  std::string correction;        ///< of the first run, in words; empty: none is possible
  Eigen::Index coordinates = 0;  ///< coordinates with the correction
};

/// Errors with 1, 2, 3, ... modes (above 6 not every number) and with all. The bench's scene must
/// come from in_modes() (sprag/reduction.h). The result does not depend on the number of threads.
/// Throws Interrupted.
std::vector<FewerModes> fewer_modes(const Bench& bench, int threads,
                                    const std::function<void(double done)>& progress);

/// Root mean square of the observed quantity about its mean [m], in the second half of the first
/// run.
double observed_motion(const Bench& bench);

std::string to_text(const Bench& bench, const std::vector<FewerModes>& table);
void write_json(const Bench& bench, const std::vector<FewerModes>& table,
                nlohmann::ordered_json& object);
/// modes,estimator,correction,coordinates,median,low,high; correction: "none" or in words.
std::string to_csv(const Bench& bench, const std::vector<FewerModes>& table);

}  // namespace sprag::tolerance
