/// \file
/// \brief Velocities, impulses and forces of the impacts of a recording, with standard deviations:
/// what `observer --impacts` writes.
///
/// The gap velocities before and after an impact follow from the estimate and the impact law, the
/// impulses from their jump, G Lambda = gamma+ - gamma-, G = W^T M^-1 W. An event that contradicts
/// the events before it is skipped.
///
/// Contacts are counted from 0.
#pragma once

#include <limits>
#include <span>
#include <stop_token>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/observer.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief A number and its standard deviation.
struct Uncertain {
  double value = 0.0;                                      ///< the number
  double sigma = std::numeric_limits<double>::infinity();  ///< infinite: unknown
};

/// \brief An event with the impulse and, at the end of a sustained contact, its force.
struct ImpactRecord {
  double t = 0.0;                                   ///< as reported [s]
  int contact = 0;                                  ///< from 0
  ContactEventKind kind = ContactEventKind::pulse;  ///< kind of event
  bool from_filter = false;                         ///< false: from the replica
  Uncertain time;           ///< estimated time, from the events up to it [s]
  Uncertain before, after;  ///< gap velocities before and after it [m/s]
  Uncertain impulse;        ///< [N s]
  /// \brief The event is the release of a contact that was held: its force after the closing,
  /// before the release, and at its maximum [N], and its impulse in between [N s], including
  /// impulses by other contacts' impacts.
  bool sustained = false;
  Uncertain force_begin, force_end, force_largest, force_impulse;  ///< if `sustained`
};

/// \brief Finds the impacts of a recording.
/// \param scene machine, start and uncertainties.
/// \param events in any order; events later than `duration` are not used.
/// \param duration end of the recording, >= 0 [s].
/// \param settings tick and estimator; the ticks do not change the result beyond rounding.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return one record for each event, in order of time. Deviations are infinite where the
/// estimator does not know them, as before the filter is confirmed.
/// \throws ModelError as Observer does.
/// \throws std::invalid_argument as Observer does, also for a negative duration.
/// \throws Interrupted if `stop` was requested.
std::vector<ImpactRecord> impacts(const Scene& scene, std::span<const ContactEvent> events,
                                  double duration, const ObserverSettings& settings = {},
                                  std::stop_token stop = {});

}  // namespace sprag
