// Free flight by ticks of a fixed step: products of one rounded step, and every so many ticks one
// step from the last anchor instead, with what excites the machine set by the time now and then, so
// that roundings do not add up.
#pragma once

#include <cstdint>

#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/instant.h"

namespace sprag {

class TickedFlight {
 public:
  /// Where the last step over several ticks ended.
  struct Anchor {
    OscillatorState x;
    unsigned ticks_since = 0;  ///< since the excitation's phases were set
  };

  TickedFlight() = default;
  /// `free` is the flow of no locked contact; it must outlive this. Tick h > 0.
  TickedFlight(const Flow& free, double h);

  /// The motion, which is on the free flow at a tick or at an event after it, is an anchor.
  static void set_anchor(const Motion& motion, Anchor& anchor) {
    anchor.x = motion.x;
    anchor.ticks_since = 0;
  }

  /// From tick k - 1, at which the motion is, to tick k. Time is counted in ticks here: the motion
  /// has no_instant until who goes on from it otherwise gives it tick k's.
  void step(std::int64_t k, Motion& motion, Anchor& anchor) const {
    motion.t = no_instant;
    if (++anchor.ticks_since % block != 0) {
      tick_.rotate(motion.x);
      if (pushed_) push(motion);
    } else {
      step_from_anchor(k, motion, anchor);
    }
  }

  /// Ticks ahead that are products of the rounded step, up to the next exact one.
  static int plain_ticks(const Anchor& anchor) {
    return static_cast<int>(block - 1 - anchor.ticks_since % block);
  }
  /// The rounded step, with which the constant forces go only where `drifts()`.
  const TickTable& table() const { return tick_; }
  bool drifts() const { return drifts_; }
  /// Whether forces near resonance are added to the product (drives.h).
  bool driven() const { return !driven_tick_.empty(); }

 private:
  static constexpr unsigned block = 64;  // ticks

  void push(Motion& motion) const;
  void step_from_anchor(std::int64_t k, Motion& motion, Anchor& anchor) const;

  const Flow* free_ = nullptr;
  double h_ = 0.0;
  unsigned phased_ = block;  // ticks after which phases are set by the time
  TickTable tick_, block_;
  DriveTable driven_tick_, driven_block_;
  bool drifts_ = false;  // a constant force pushes
  bool pushed_ = false;  // or a force near resonance
};

}  // namespace sprag
