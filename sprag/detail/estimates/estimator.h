// Interface of all estimators: a state with value semantics, which contact events alone move from
// tick to tick, and a report of the estimate's own error.
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstdint>
#include <span>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/model.h"

namespace sprag {

/// E::State holds everything that changes, with `tick` and `chi`. Copies between states of one
/// estimator do not allocate. Of the functions only start() and no_confidence() allocate. h is the
/// tick [s]; q and u have f entries each.
///    start(start, k, chi, state)      puts the state at (q, u) with chi, at tick k
///    tick(events, state)              moves to the next tick through the events up to it
///    apply(events, state)             applies events of the present instant, at a start
///    output(state, q, u)              estimate at the present tick
///    no_confidence()                  a Confidence with room for all results
///    note(state, to)                  fills in counts, innovations and from_filter, at little
///    cost.
///                                     The bound is that of guarantee.h
template <typename E>
concept Estimator = requires(E estimator, const E& constant, typename E::State& state,
                             const typename E::State& present, const State& start, std::int64_t k,
                             ContactSet chi, std::span<const ContactEvent> events,
                             Eigen::Ref<Eigen::VectorXd> x, Confidence& confidence) {
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
};

}  // namespace sprag
