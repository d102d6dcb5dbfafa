// What an estimate says of its own error, without knowing the truth.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "sprag/detail/estimates/innovation.h"

namespace sprag {

/// What an innovation that does not fit points to.
enum class Suspicion : std::int8_t {
  none = 0,
  model = 1,           ///< the contact was near, but not there: model, uncertainty or event times
  spurious_event = 2,  ///< no contact was near
  missing_event = 3    ///< the estimate had gone through the support before
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
  double t = -1.0;  ///< [s]; before the first one -1
  int contact = 0;  ///< from 0
  Suspicion suspicion = Suspicion::none;
  double square = 0.0;  ///< of the innovation, over the variance that it should have
  /// Records before this event are known to be lost, as the numbers of the messages say.
  bool known_loss = false;
};

/// Contacts that were reported closed while others already held their directions.
struct Redundancy {
  std::int64_t closings = 0;
  int contact = 0;  ///< the last of them, from 0: it carries no force of its own
};

/// What is known of the machine's parameters, where they are estimated with its state.
struct ParameterEstimates {
  /// Keys of the scene file, P of them; null: none are estimated.
  std::shared_ptr<const std::vector<std::string>> keys;
  Eigen::VectorXd values,
      sigmas;              ///< P entries each; sigmas are infinite where they are the scene's
  double accepted = -1.0;  ///< since when those that were identified last count [s]; -1: none do
  double known = -1.0;     ///< the last event that they are from [s]
  std::int64_t identifications = 0;  ///< how many were tried

  bool any() const { return keys != nullptr; }
};

struct Confidence {
  bool has_replica = false;  ///< a replica runs: `bound` and `replica` are its own
  bool has_filter = false;   ///< an event filter runs: all the rest is its own
  bool from_filter = false;  ///< the estimate that goes with this is the filter's
  double penetration = 0.0;  ///< depth of the estimate inside a support [m] (penetration.h)
  double bound = std::numeric_limits<double>::infinity();  ///< V of the replica is at most this
  Eigen::VectorXd sigma_q, sigma_u;  ///< standard deviations, f entries each; empty: no filter
  Eigen::VectorXd sigma_g;           ///< of the gaps, m entries [m]
  Eigen::VectorXd sigma_outputs;     ///< of the model's outputs, one each
  /// Guaranteed half-widths about the estimate, of q (f entries), gaps (m) and outputs: the bound
  /// as lengths (sprag/detail/bound/half_width.h); empty where no bound is given.
  Eigen::VectorXd bound_q, bound_g, bound_outputs;
  /// How often a filter's estimate has come to lie further from the replica's than the bound and
  /// its own sigma allow: it is false then, and the replica's is shown
  /// (sprag/detail/bound/guarantee.h).
  std::int64_t refutations = 0;
  Innovation replica, filter;        ///< of the same closing
  std::int64_t inconsistencies = 0;  ///< how often the filter did not fit the events
  Inconsistency last;
  bool scale_is_lost = false;  ///< a filter alone is never sure again: no event tells it
  std::int64_t forgotten = 0;  ///< how often the filter had no room left and started again
  Redundancy redundancy;
  std::int64_t refused_impacts = 0;  ///< contacts that could not be held together, though closed
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
