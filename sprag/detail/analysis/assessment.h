// Checks what an estimator can achieve with a scene, before any recording exists.
//
// Replica: checks every assumption of Theorem 1 of Baumann & Leine 2014, under which the replica
// synchronizes with its master, and the quantities that set the rate. The theorem needs the machine
// (2)-(6) with M, C, K > 0 and linearly independent columns of W, and
//
// - A1: the contact states chi are of class K^n, so that no contact stays closed for ever;
// - A2: a bounded motion exists;
// - A3: the impact law is maximal monotone.
//
// Timing filter: tries whether the machine's events make its state observable.
//
// Contacts are counted from 0 in C++, and from 1 in texts for people.
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

/// Result of one check.
struct Finding {
  std::string id;           ///< short name: "M", "A1", "by_filter", ...
  bool required = true;     ///< the theorem or the clutches need it; false: information only
  bool holds = true;        ///< the check passed
  std::string what;         ///< result in words, with figures
  std::string change = {};  ///< suggested change; empty: none
  /// Condition on which it holds, "time windows ... recur"; empty: unconditional.
  std::string provided = {};
};

/// All checks of one scene. Times are in the scene's unit of time.
struct Assessment {
  std::string scene;                   ///< name of the scene
  int coordinates = 0;                 ///< f
  ImpactLaw law = ImpactLaw::poisson;  ///< of the model
  Definiteness M, C, K;                ///< definiteness of the three matrices
  /// Independence of the contact directions. This and all fields below are set only if M is
  /// positive definite.
  Directions W;
  std::vector<OpposingStops> opposing;  ///< pairs of contacts on either side of one coordinate
  Monotonicity monotonicity;            ///< of the impact law
  std::vector<Mode> modes;              ///< undamped modes, and how contacts see them
  FlowPath path = FlowPath::diagonal;   ///< kind of exact flow in free flight
  double slow_root = 0.0;  ///< largest real part of the eigenvalues of the damped machine
  double decades = 0.0;    ///< decades of V per unit of time by damping alone
  double omega_max = 0.0;  ///< largest frequency of the undamped modes [rad per unit of time]
  Trial trial;             ///< short simulation of the master
  std::optional<FilterTrial> filter;  ///< empty for the scene of a reduced machine
  std::optional<Accuracy> accuracy;   ///< set by assess_accuracy()

  std::vector<Finding> findings;  ///< in the order of the report

  /// Whether the replica synchronizes, by Theorem 1: all required findings hold.
  bool synchronizes() const;
  /// The same as "will synchronize" or "may not synchronize".
  const char* verdict() const;
  /// Conditions of the verdict that cannot be checked in advance: Finding::provided of the required
  /// findings.
  std::vector<std::string> conditions() const;
  /// Whether the default estimator `both` is expected to find the machine's motion: the replica
  /// synchronizes or the filter of the trial follows the machine.
  bool both_follows() const;
};

/// Runs all checks except the accuracy of fewer modes. The result is incomplete if M is not
/// positive definite. Throws ModelError if the machine has no exact flow in free flight, or
/// Interrupted.
Assessment assess(const Scene& scene, const TrialLimits& limits = {});

/// Finds how many modes an observer needs for a change of the tip or gaps of at most `tolerance` >
/// 0 [m], over the duration of the trial. Adds Assessment::accuracy and a finding "accuracy" that
/// is not required. If damping couples the modes, or the master cannot continue, only the finding
/// is added. `assessment` is that of assess() for this scene. Throws Interrupted.
void assess_accuracy(const Scene& scene, double tolerance, const TrialLimits& limits,
                     Assessment& assessment);

/// First lines of to_text() without the scene's name: whether the default estimator follows the
/// machine, why, and on which conditions.
std::string headline(const Assessment& assessment);

/// Report for people: headline, reasons and figures with four significant digits, at most 100
/// columns wide.
std::string to_text(const Assessment& assessment);

/// A number with four significant digits.
std::string readable(double value);

}  // namespace sprag
