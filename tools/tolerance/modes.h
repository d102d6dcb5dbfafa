// How few modes an observer needs: the machine gives the events, an estimator of its first modes
// alone follows them, without and with the correction for the other modes that the events choose
// (sprag/detail/analysis/reduction_choice.h).
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "sprag/detail/analysis/reduction_choice.h"
#include "tools/tolerance/search.h"

namespace sprag::tolerance {

struct FewerModes {
  int modes = 0;
  /// By estimator: root mean square of the error of what is observed, the tip of a beam or else the
  /// gap at each contact [m], in the second half of a run; infinity where there is no such
  /// observer.
  std::vector<Spread> plain, corrected;
  std::string correction;        ///< of the first run, in words; empty: none is tried
  Eigen::Index coordinates = 0;  ///< with it
};

/// With 1, 2, 3, ... modes, above 6 not with every number of them, and with all. The bench is one
/// of a scene that in_modes() (sprag/reduction.h) has made. The same for any number of
/// threads. Throws Interrupted.
std::vector<FewerModes> fewer_modes(const Bench& bench, int threads,
                                    const std::function<void(double done)>& tell);

/// Root mean square of what is observed about its mean [m], in the second half of the first run.
double observed_motion(const Bench& bench);

std::string to_text(const Bench& bench, const std::vector<FewerModes>& table);
void write_json(const Bench& bench, const std::vector<FewerModes>& table,
                nlohmann::ordered_json& object);
/// modes,estimator,correction,coordinates,median,low,high; correction: "none" or in words.
std::string to_csv(const Bench& bench, const std::vector<FewerModes>& table);

}  // namespace sprag::tolerance
