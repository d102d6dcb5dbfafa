// A timing filter and the master that it follows, for tests that inspect its state.
#pragma once

#include <algorithm>
#include <vector>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/scene.h"
#include "tests/support/tracking_estimators.h"

namespace sprag {

/// The master and a filter that receives its events, tick by tick.
struct Pursuit {
  Pursuit(const Scene& scene, double h)
      : scene_(scene),
        h_(h),
        master(scene.model, scene.truth.start),
        filter(scene, h),
        energy_(scene.model),
        truth{scene.truth.start.q, scene.truth.start.u},
        mean(truth) {
    filter.start(scene.prior.start, 0, 0, state);
  }

  /// One tick; `spoil` may change the events.
  template <typename Spoil>
  double tick(const Spoil& spoil) {
    ++k_;
    events_.clear();
    master.advance(tick_instant(k_, h_), events_);
    impacts += static_cast<int>(events_.size());
    spoil(events_);
    // The filter requires events within the tick, in order.
    double last = tick_instant(k_ - 1, h_).hi;
    for (ContactEvent& event : events_) {
      last = event.t = std::clamp(event.t, last, tick_instant(k_, h_).hi);
    }
    filter.tick(events_, state);
    master.state(tick_instant(k_, h_), truth.q, truth.u);
    filter.output(state, mean.q, mean.u);
    return energy_(truth.q, truth.u, mean.q, mean.u)[0];
  }
  double tick() {
    return tick([](auto&) {});
  }

  const Scene& scene_;
  double h_;
  Master master;
  TimingEstimator filter;
  TrackingState state;
  ErrorEnergy energy_;
  State truth, mean;
  std::vector<ContactEvent> events_;
  std::int64_t k_ = 0;
  int impacts = 0;
};

}  // namespace sprag
