// What all estimators have in common: a state that is a value, put at a start and taken from tick
// to tick by contact events alone, and what each says of its own error.
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstdint>
#include <span>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/confidence.h"
#include "sprag/model.h"

namespace sprag {

/// The replica alone; the event filter alone; the filter, and the replica where it does not fit; or
/// the same with a model that is identified.
enum class EstimatorKind { replica, timing, both, adaptive };

/// E::State holds everything that changes, with `tick` and `chi`. Copies between states of one
/// estimator do not allocate, nor does anything here but start() and no_confidence(). h is a tick
/// [s]; q and u have f entries each.
///   start(start, k, chi, state)      puts it at (q, u) with chi, at tick k
///   tick(events, state)              moves to the next tick, through the events up to it
///   apply(events, state)             those of the present instant, at a start
///   output(state, q, u)              the estimate at the present tick
///   no_confidence()                  room for all that it says of its error
///   note(state, to)                  fills in what has happened: counts, innovations, whose
///                                    estimate it is; costs next to nothing
///   confidence(state, initial, to)   fills in all, deviations and bound too; `initial` is B(0),
///                                    +infinity where no bound holds any longer
template <typename E>
concept Estimator = requires(E estimator, const E& constant, typename E::State& state,
                             const typename E::State& present, const State& start, std::int64_t k,
                             ContactSet chi, std::span<const ContactEvent> events,
                             Eigen::Ref<Eigen::VectorXd> x, double initial,
                             Confidence& confidence) {
  requires std::copyable<typename E::State>;
  { present.tick } -> std::convertible_to<std::int64_t>;
  { present.chi } -> std::convertible_to<ContactSet>;
  { constant.h() } -> std::same_as<double>;
  estimator.start(start, k, chi, state);
  estimator.tick(events, state);
  estimator.apply(events, state);
  estimator.output(present, x, x);
  { constant.no_confidence() } -> std::same_as<Confidence>;
  constant.note(present, confidence);
  estimator.confidence(present, initial, confidence);
};

}  // namespace sprag
