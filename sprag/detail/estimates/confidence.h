// Report of an estimator on its own error.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/estimates/innovation.h"

namespace sprag {

/// Likely cause of a gate failure.
enum class Suspicion : std::int8_t {
  none = 0,
  model = 1,  ///< the contact was near its support: model, uncertainty or event times are wrong
  spurious_event = 2,  ///< the contact was far from its support
  missing_event = 3    ///< the estimate had passed through the support before
};

/// "none", "model", "spurious event", "missing event".
constexpr const char* name(Suspicion suspicion) {
  switch (suspicion) {
    case Suspicion::model:
      return "model";
    case Suspicion::spurious_event:
      return "spurious event";
    case Suspicion::missing_event:
      return "missing event";
    default:
      return "none";
  }
}

struct Inconsistency {
  double t = -1.0;  ///< [s]; -1: none yet
  int contact = 0;  ///< from 0
  Suspicion suspicion = Suspicion::none;
  double square = 0.0;  ///< normalized innovation squared
  /// Records before this event are lost, by the numbers of the messages.
  bool known_loss = false;
};

/// Contacts that were reported closed while locked contacts already held their directions.
struct Redundancy {
  std::int64_t closings = 0;
  int contact = 0;  ///< last such contact, from 0; it carries no force of its own
};

/// Parameters of the machine that are estimated with its state.
struct ParameterEstimates {
  /// Keys of the scene file, P of them; null: none are estimated.
  std::shared_ptr<const std::vector<std::string>> keys;
  Eigen::VectorXd values,
      sigmas;              ///< P entries each; sigma is infinite where the value is the scene's
  double accepted = -1.0;  ///< when identified values were last adopted [s]; -1: never
  double known = -1.0;     ///< last event that they are identified from [s]
  std::int64_t identifications = 0;  ///< number of attempts

  bool any() const { return keys != nullptr; }
};

struct Confidence {
  bool has_replica = false;  ///< a replica runs; `bound` and `replica` belong to it
  bool has_filter = false;   ///< an event filter runs; all other fields belong to it
  bool from_filter = false;  ///< the estimate is the filter's; false: the replica's
  double penetration = 0.0;  ///< depth of the estimate inside a support [m] (penetration.h)
  double bound = std::numeric_limits<double>::infinity();  ///< bound on the replica's V
  Eigen::VectorXd sigma_q, sigma_u;  ///< standard deviations, f entries each; empty: no filter
  Eigen::VectorXd sigma_g;           ///< standard deviations of the gaps, m entries [m]
  Eigen::VectorXd sigma_outputs;     ///< standard deviations of the model's outputs
  /// Guaranteed half-widths about the estimate, of q (f entries), gaps (m) and outputs: the bound
  /// as lengths (sprag/detail/bound/half_width.h); empty where no bound is given.
  Eigen::VectorXd bound_q, bound_g, bound_outputs;
  /// Number of refutations: the filter's estimate came to differ from the replica's by more than
  /// the bound and its own sigma admit. The filter is then wrong, and the replica is shown
  /// (sprag/detail/bound/guarantee.h).
  std::int64_t refutations = 0;
  Innovation replica, filter;        ///< at the same closing
  std::int64_t inconsistencies = 0;  ///< number of gate failures of the filter
  Inconsistency last;
  bool scale_is_lost = false;  ///< the scale of the motion is unobservable: a filter alone never
                               ///< confirms its track again
  std::int64_t forgotten = 0;  ///< number of resets of the filter for lack of room
  Redundancy redundancy;
  std::int64_t refused_impacts = 0;  ///< contradictory contacts: no motion satisfies all of them
  ParameterEstimates parameters;
};

/// Standard deviation of output number i, from 0; infinite without a filter.
inline double sigma_of_output(const Confidence& confidence, std::size_t i) {
  const auto k = static_cast<Eigen::Index>(i);
  return k < confidence.sigma_outputs.size() ? confidence.sigma_outputs[k]
                                             : std::numeric_limits<double>::infinity();
}

/// Guaranteed half-width of output number i, from 0; infinite where no bound is given.
inline double bound_of_output(const Confidence& confidence, std::size_t i) {
  const auto k = static_cast<Eigen::Index>(i);
  return k < confidence.bound_outputs.size() ? confidence.bound_outputs[k]
                                             : std::numeric_limits<double>::infinity();
}

}  // namespace sprag
