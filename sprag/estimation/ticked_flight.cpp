#include "sprag/estimation/ticked_flight.h"

namespace sprag {

TickedFlight::TickedFlight(const Flow& free, double h)
    : free_(&free),
      h_(h),
      tick_(free.oscillators(), h),
      block_(free.oscillators(), block * h),
      driven_tick_(free.oscillators(), free.drives(), h),
      driven_block_(free.oscillators(), free.drives(), block * h),
      drifts_(free.pushed()) {}

void TickedFlight::step_from_anchor(std::int64_t k, Motion& motion, Anchor& anchor) const {
  block_.apply(anchor.x, motion.alpha, drifts_, motion.x);
  free_->set_phases(tick_instant(k, h_), motion.x);
  driven_block_.apply(motion.x);
  set_anchor(motion, anchor);
}

}  // namespace sprag
