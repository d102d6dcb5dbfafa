/// \file
/// \brief Predicts the next contact events of a machine.
///
/// Each predicted time has a standard deviation, from the estimator's belief about the state. The
/// list ends where the events that follow are uncertain: in their order, or by more than a quarter
/// of the interval before them, or not linear in the state.
///
/// Contacts are counted from 0.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/observer.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief One predicted event.
struct PredictedEvent {
  double t = 0.0;                                   ///< [s]
  int contact = 0;                                  ///< from 0
  ContactEventKind kind = ContactEventKind::pulse;  ///< `closes`: a sustained contact begins
  double sigma = 0.0;                               ///< standard deviation of t [s]
};

/// \brief Predicted events of a machine.
struct Prediction {
  double made_at = 0.0;                ///< time of the belief [s]
  double certain_until = 0.0;          ///< no event but the listed is expected up to here [s]
  std::vector<PredictedEvent> events;  ///< in order of time
};

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
