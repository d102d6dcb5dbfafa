/// \file
/// \brief Kinds of estimators, and the report of an estimator on its own error.
///
/// sigma is a standard deviation, calibrated by trials. B is a bound on the error energy V, proven.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace sprag {

/// \brief Kind of estimator.
enum class EstimatorKind {
  replica,  ///< the replica of Baumann & Leine 2014 alone
  timing,   ///< the event filter alone
  both,     ///< the filter while its track is confirmed, else the replica
  adaptive  ///< both, with an identified model
};

/// \brief How sure the filter must be of its track before it shows an estimate with a sigma.
///
/// After events that do not fit, a track counts only when 2f events have fitted, which determine
/// the state, and some more. docs/measurements/robustness.md has what each level costs.
enum class ConfidenceLevel {
  low,     ///< 1 more: far more estimates under lost events, of which more are wrong
  medium,  ///< 2 more
  high     ///< 8 more: a claimed sigma is right as often as it says, also under lost events
};

/// \brief Name of a level, as in scene files.
/// \param level the level.
/// \return "low", "medium" or "high".
constexpr const char* name(ConfidenceLevel level) {
  switch (level) {
    case ConfidenceLevel::low:
      return "low";
    case ConfidenceLevel::medium:
      return "medium";
    default:
      return "high";
  }
}

/// \brief Innovation of the last reported closing: the gap that the estimate predicts there.
///
/// It is zero for a perfect estimate.
struct Innovation {
  double t = -1.0;         ///< time of the closing [s]; -1: none yet
  int contact = 0;         ///< from 0
  double gap = 0.0;        ///< gap of the estimate just before [m]
  double deviation = 0.0;  ///< standard deviation of the gap [m]; 0: not estimated
};

/// \brief Likely cause of a gate failure.
enum class Suspicion : std::int8_t {
  none = 0,            ///< no failure
  model = 1,           ///< the contact was near its support: model, uncertainty or event times are
                       ///< wrong
  spurious_event = 2,  ///< the contact was far from its support
  missing_event = 3    ///< the estimate had passed through the support before
};

/// \brief Name of a suspicion.
/// \param suspicion the suspicion.
/// \return "none", "model", "spurious event" or "missing event".
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

/// \brief An event that the filter's gate has refused.
struct Inconsistency {
  double t = -1.0;                        ///< [s]; -1: none yet
  int contact = 0;                        ///< from 0
  Suspicion suspicion = Suspicion::none;  ///< likely cause
  double square = 0.0;                    ///< normalized innovation squared
  bool known_loss = false;  ///< records before this event are lost, by the numbers of the messages
};

/// \brief Contacts that were reported closed while locked contacts already held their directions.
struct Redundancy {
  std::int64_t closings = 0;  ///< number of such reports
  int contact = 0;            ///< last such contact, from 0; it carries no force of its own
};

/// \brief P parameters of the machine that are estimated with its state.
struct ParameterEstimates {
  /// \brief Keys of the scene file, P of them; null: none are estimated.
  std::shared_ptr<const std::vector<std::string>> keys;
  Eigen::VectorXd values;            ///< P entries
  Eigen::VectorXd sigmas;            ///< P entries; infinite where the value is the scene's
  double accepted = -1.0;            ///< when identified values were last adopted [s]; -1: never
  double known = -1.0;               ///< last event that they are identified from [s]
  std::int64_t identifications = 0;  ///< number of attempts

  /// \brief Whether parameters are estimated.
  /// \return true if they are.
  bool any() const { return keys != nullptr; }
};

/// \brief Report of an estimator about its own error, for f coordinates and m contacts.
struct Confidence {
  bool has_replica = false;  ///< a replica runs; `bound` and `replica` belong to it
  bool has_filter = false;   ///< an event filter runs; all other fields belong to it
  bool from_filter = false;  ///< the estimate is the filter's; false: the replica's
  double penetration = 0.0;  ///< depth of the estimate inside a support [m]
  double bound = std::numeric_limits<double>::infinity();  ///< bound B on the replica's V
  Eigen::VectorXd sigma_q;  ///< standard deviations of q, f entries; empty: no filter
  Eigen::VectorXd sigma_u;  ///< standard deviations of u, f entries; empty: no filter
  Eigen::VectorXd sigma_g;  ///< standard deviations of the gaps, m entries [m]; empty: no filter
  Eigen::VectorXd sigma_outputs;  ///< standard deviations of the model's outputs; empty: no filter
  /// \brief Guaranteed half-widths about the estimate of q (f entries): the bound as lengths. Empty
  /// where no bound is given.
  Eigen::VectorXd bound_q;
  Eigen::VectorXd bound_g;        ///< the same of the gaps, m entries
  Eigen::VectorXd bound_outputs;  ///< the same of the model's outputs
  /// \brief Number of refutations: the filter's estimate came to differ from the replica's by more
  /// than the bound and its own sigma admit. The filter is then wrong, and the replica is shown.
  std::int64_t refutations = 0;
  Innovation replica;                ///< of the replica at the last closing
  Innovation filter;                 ///< of the filter at the same closing
  std::int64_t inconsistencies = 0;  ///< number of gate failures of the filter
  Inconsistency last;                ///< the last of them
  bool scale_is_lost = false;  ///< the scale of the motion is unobservable: a filter alone never
                               ///< confirms its track again
  std::int64_t forgotten = 0;  ///< number of resets of the filter for lack of room
  Redundancy redundancy;       ///< redundant closings
  std::int64_t refused_impacts = 0;  ///< contradictory contacts: no motion satisfies all of them
  ParameterEstimates parameters;     ///< parameters of an adaptive estimator
};

/// \brief Standard deviation of an output.
/// \param confidence report of an estimator.
/// \param i number of the output, from 0.
/// \return its standard deviation; infinite without a filter.
inline double sigma_of_output(const Confidence& confidence, std::size_t i) {
  const auto k = static_cast<Eigen::Index>(i);
  return k < confidence.sigma_outputs.size() ? confidence.sigma_outputs[k]
                                             : std::numeric_limits<double>::infinity();
}

/// \brief Guaranteed half-width of an output.
/// \param confidence report of an estimator.
/// \param i number of the output, from 0.
/// \return its half-width; infinite where no bound is given.
inline double bound_of_output(const Confidence& confidence, std::size_t i) {
  const auto k = static_cast<Eigen::Index>(i);
  return k < confidence.bound_outputs.size() ? confidence.bound_outputs[k]
                                             : std::numeric_limits<double>::infinity();
}

}  // namespace sprag
