// Free flight by ticks of a fixed step: products of one rounded step matrix. Every `block` ticks
// one long step from the last anchor replaces the product, and from time to time the excitation's
// phases are set from the time, so that roundings do not accumulate.
#pragma once

#include <cstdint>

#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {

class TickedFlight {
 public:
  /// End of the last long step.
  struct Anchor {
    OscillatorState x;
    unsigned ticks_since = 0;  ///< ticks since the excitation's phases were set
  };

  TickedFlight() = default;
  /// `free` is the flow without locked contacts; it must outlive this. Tick h > 0.
  TickedFlight(const Flow& free, double h);

  /// Makes the motion the anchor. It is on the free flow, at a tick or at an event after it.
  static void set_anchor(const Motion& motion, Anchor& anchor) {
    anchor.x = motion.x;
    anchor.ticks_since = 0;
  }

  /// Moves from tick k - 1 to tick k. The motion's time becomes no_instant; a caller that needs it
  /// sets that of tick k.
  void step(std::int64_t k, Motion& motion, Anchor& anchor) const {
    step_modes(k, motion, anchor);
    if (sampled_) set_inputs(k, motion);
  }

  /// The same without the entries of sampled inputs, which set_inputs() sets. No later step depends
  /// on them.
  void step_modes(std::int64_t k, Motion& motion, Anchor& anchor) const {
    motion.t = no_instant;
    if (++anchor.ticks_since % block != 0) {
      tick_.rotate(motion.x);
      if (pushed_) push(motion);
    } else {
      step_from_anchor(k, motion, anchor);
    }
  }
  void set_inputs(std::int64_t k, Motion& motion) const {
    free_->sampled()->set(tick_instant(k, h_), motion.x);
  }
  /// Whether the machine has sampled inputs.
  bool sampled() const { return sampled_; }

 private:
  static constexpr unsigned block = 64;  // ticks

  void push(Motion& motion) const;
  void step_from_anchor(std::int64_t k, Motion& motion, Anchor& anchor) const;

  const Flow* free_ = nullptr;
  double h_ = 0.0;
  unsigned phased_ = block;  // ticks after which the phases are set from the time
  TickTable tick_, block_;
  DriveTable driven_tick_, driven_block_;
  bool drifts_ = false;  // there is a constant force
  bool pushed_ = false;  // drifts_, or a force near resonance
  bool sampled_ = false;
};

}  // namespace sprag
