/// \file
/// \brief Velocities, impulses and forces of the impacts of a recording, and predictions from it,
/// with standard deviations: what `observer --impacts` and `--predict` write.
///
/// The gap velocities before and after an impact follow from the estimate and the impact law, the
/// impulses from their jump, G Lambda = gamma+ - gamma-, G = W^T M^-1 W (impact_record.h).
/// Prediction: prediction.h. An event that contradicts the events before it is skipped.
///
/// Contacts are counted from 0.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/impact_record.h"
#include "sprag/observer.h"
#include "sprag/prediction.h"
#include "sprag/scene.h"

namespace sprag {

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

/// \brief Predicts contact events after a recording.
/// \param scene machine, start and uncertainties.
/// \param events in any order; events later than `t` are not used.
/// \param t time of the prediction, >= 0; it is made at the last tick at or before it [s].
/// \param ahead predicted duration, > 0 [s].
/// \param settings tick and estimator.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return the prediction, without events while the filter is not confirmed.
/// \throws ModelError as Observer does.
/// \throws std::invalid_argument as Observer does, also for `t` or `ahead` out of range.
/// \throws Interrupted if `stop` was requested.
Prediction predict(const Scene& scene, std::span<const ContactEvent> events, double t, double ahead,
                   const ObserverSettings& settings = {}, std::stop_token stop = {});

}  // namespace sprag
