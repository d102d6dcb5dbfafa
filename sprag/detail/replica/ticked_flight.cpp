#include "sprag/detail/replica/ticked_flight.h"

#include <algorithm>

namespace sprag {
namespace {

// The phases lose about one rounding per radian until they are set from the time.
unsigned blocks_between_phases(const Flow& free, double duration) {
  constexpr double radians = 16.0, most = 16.0;
  if (free.harmonics() == 0) return 1;
  const double Omega = free.oscillators().root_kappa().head(free.harmonics()).maxCoeff();
  return static_cast<unsigned>(std::clamp(radians / (Omega * duration), 1.0, most));
}

}  // namespace

TickedFlight::TickedFlight(const Flow& free, double h)
    : free_(&free),
      h_(h),
      phased_(block * blocks_between_phases(free, block * h)),
      tick_(free.oscillators(), h),
      block_(free.oscillators(), block * h),
      driven_tick_(free.oscillators(), free.drives(), h),
      driven_block_(free.oscillators(), free.drives(), block * h),
      drifts_(free.pushed()),
      pushed_(drifts_ || !driven_tick_.empty()),
      sampled_(free.sampled() != nullptr) {}

void TickedFlight::push(Motion& motion) const {
  if (drifts_) tick_.push(motion.alpha, motion.x);
  driven_tick_.apply(motion.x);
}

void TickedFlight::step_from_anchor(std::int64_t k, Motion& motion, Anchor& anchor) const {
  OscillatorState& x = anchor.x;
  block_.rotate(x);
  if (drifts_) block_.push(motion.alpha, x);
  if (anchor.ticks_since == phased_) {
    free_->set_harmonics(tick_instant(k, h_), x);
    anchor.ticks_since = 0;
  }
  driven_block_.apply(x);
  motion.x = x;
}

}  // namespace sprag
