// What estimators may expect of a scene. The timing filter: whether events tell all of the motion
// (filter_trial.h). The replica: whether it will synchronize with its master: every assumption of
// Theorem 1 of Baumann & Leine 2014, and what else decides how fast. The machine (2)-(6) has M, C,
// K > 0 and independent columns of W; A1: the contacts' switching functions chi are of class K^n,
// so that no contact stays closed for ever; A2: there is a bounded motion; A3: the impact law is
// maximal monotone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/analysis/accuracy.h"
#include "sprag/detail/analysis/filter_trial.h"
#include "sprag/detail/analysis/structure.h"
#include "sprag/detail/analysis/trial.h"
#include "sprag/detail/mechanics/definiteness.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/scene.h"

namespace sprag {

struct Finding {
  std::string id;
  bool required = true;  ///< by the theorem or by the clutches; others only tell
  bool holds = true;
  std::string what;
  std::string change;  ///< what to change; empty where nothing needs to be
  std::string provided =
      {};  ///< "time windows ... recur": on what it holds; empty: without a condition
};

struct Assessment {
  std::string scene;
  int coordinates = 0;
  ImpactLaw law = ImpactLaw::poisson;
  Definiteness M, C, K;
  /// The rest is there only if M is positive definite.
  Directions W;
  std::vector<OpposingStops> opposing;
  Monotonicity monotonicity;
  std::vector<Mode> modes;
  FlowPath path = FlowPath::diagonal;
  double slow_root = 0.0;    ///< largest real part of the damped machine's eigenvalues
  double decades = 0.0;      ///< of V per unit of time without impacts
  double omega_max = 0.0;    ///< of the undamped modes
  double moreau_tick = 0.0;  ///< 20 ticks per period of the fastest mode; infinity if none vibrates
  Trial trial;
  std::optional<FilterTrial> filter;  ///< none for the scene of a reduced machine
  std::optional<Accuracy> accuracy;   ///< if asked for

  std::vector<Finding> findings;

  /// All required findings hold.
  bool synchronizes() const;
  /// "will synchronize" or "may not synchronize": the replica, by Theorem 1.
  const char* verdict() const;
  /// On what that depends beyond what can be checked: `provided` of the required findings.
  std::vector<std::string> conditions() const;
  /// Whether the default estimator, `both`, is expected to find the machine's motion: by its
  /// filter, as in the trial, or by its replica.
  bool both_follows() const;
};

/// Throws ModelError if the machine has no exact flow in free flight.
Assessment assess(const Scene& scene, const TrialLimits& limits = {});

/// Adds how many modes an observer needs for the tolerance [m] > 0, over the duration of the trial:
/// `accuracy` and a finding that is not required; where damping couples the modes only the finding.
/// The assessment must be of this scene.
void assess_accuracy(const Scene& scene, double tolerance, const TrialLimits& limits,
                     Assessment& assessment);

/// Whether the default estimator follows the machine, why, and on what conditions: the first lines
/// of to_text(), without the scene's name.
std::string headline(const Assessment& assessment);

/// For people: headline, reasons and figures, four significant digits, at most 100 columns.
std::string to_text(const Assessment& assessment);

/// Four significant digits.
std::string readable(double value);

}  // namespace sprag
