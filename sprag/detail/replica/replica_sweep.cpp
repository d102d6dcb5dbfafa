#include "sprag/detail/replica/replica_sweep.h"

#include <algorithm>
#include <limits>

#include "sprag/detail/mechanics/widest.h"

namespace sprag {
namespace {

constexpr std::size_t lanes = ReplicaSweep::lanes;
using Oscillator = ReplicaSweep::Oscillator;

// R oscillators at once hide the latency of multiplication and addition. The compiler keeps the
// local copies in registers; it must not split the lanes.
template <std::size_t R, bool drifts>
[[gnu::always_inline]] inline void rotate_together(Oscillator* __restrict x, int ticks) {
  constexpr std::size_t n = R * lanes;
  double z[n], v[n], zz[n], zv[n], vz[n], vv[n];
  double z_push[drifts ? n : 1], v_push[drifts ? n : 1];
  for (std::size_t r = 0; r < R; ++r) {
    for (std::size_t l = 0; l < lanes; ++l) {
      const std::size_t i = r * lanes + l;
      z[i] = x[r].z[l];
      v[i] = x[r].v[l];
      zz[i] = x[r].zz[l];
      zv[i] = x[r].zv[l];
      vz[i] = x[r].vz[l];
      vv[i] = x[r].vv[l];
      if constexpr (drifts) {
        z_push[i] = x[r].z_push[l];
        v_push[i] = x[r].v_push[l];
      }
    }
  }
  for (int k = 0; k < ticks; ++k) {
#pragma GCC unroll 1
    for (std::size_t i = 0; i < n; ++i) {
      double moved = zz[i] * z[i] + zv[i] * v[i];
      double rate = vz[i] * z[i] + vv[i] * v[i];
      if constexpr (drifts) {
        moved += z_push[i];
        rate += v_push[i];
      }
      z[i] = moved;
      v[i] = rate;
    }
  }
  for (std::size_t r = 0; r < R; ++r) {
    for (std::size_t l = 0; l < lanes; ++l) {
      x[r].z[l] = z[r * lanes + l];
      x[r].v[l] = v[r * lanes + l];
    }
  }
}

SPRAG_WIDEST void rotate(Oscillator* x, std::size_t n, int ticks) {
  for (; n >= 4; n -= 4, x += 4) rotate_together<4, false>(x, ticks);
  if (n >= 2) {
    rotate_together<2, false>(x, ticks);
    x += 2;
  }
  if (n % 2 != 0) rotate_together<1, false>(x, ticks);
}

SPRAG_WIDEST void rotate_and_push(Oscillator* x, std::size_t n, int ticks) {
  for (; n >= 2; n -= 2, x += 2) rotate_together<2, true>(x, ticks);
  if (n != 0) rotate_together<1, true>(x, ticks);
}

Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

void require_one_structure(std::span<const ReplicaSweep::Run> runs) {
  if (runs.empty() || runs.size() > lanes) throw ModelError("a sweep has one to eight runs");
  for (const ReplicaSweep::Run& run : runs) {
    if (!ReplicaSweep::of_one_structure(*run.flows, *runs.front().flows)) {
      throw ModelError(
          "the machines of a sweep differ in the number of coordinates, contacts or frequencies");
    }
  }
}

}  // namespace

bool ReplicaSweep::of_one_structure(const Flows& a, const Flows& b) {
  const auto& x = a.dynamics();
  const auto& y = b.dynamics();
  return x.coordinates() == y.coordinates() && x.contacts() == y.contacts() &&
         x.frequencies().size() == y.frequencies().size() &&
         x.inputs().channels() == y.inputs().channels();
}

ReplicaSweep::ReplicaSweep(std::span<const Run> runs, double h) : h_(h) {
  require_one_structure(runs);
  oscillators_.resize(static_cast<std::size_t>((*runs.front().flows)[0].size()));
  lane_.resize(runs.size());
  for (std::size_t l = 0; l < runs.size(); ++l) {
    Lane& lane = lane_[l];
    lane.replica = std::make_unique<Replica>(runs[l].flows, h);
    lane.replica->start(runs[l].start, 0, runs[l].chi, lane.state);
    lane.events = runs[l].events;
    lane.ticks = runs[l].ticks;
    const std::size_t at_start = due(lane.events, 0);
    if (at_start > 0) lane.replica->apply(lane.events.first(at_start), lane.state);
    lane.events = lane.events.subspan(at_start);
    find_event_tick(lane);
    const TickedFlight& flight = lane.replica->flight();
    drifts_ = drifts_ || flight.drifts();
    for (std::size_t i = 0; i < oscillators_.size(); ++i) {
      Oscillator& x = oscillators_[i];
      x.zz[l] = flight.table().zz[index(i)];
      x.zv[l] = flight.table().zv[index(i)];
      x.vz[l] = flight.table().vz[index(i)];
      x.vv[l] = flight.table().vv[index(i)];
    }
    rest(l);
  }
}

void ReplicaSweep::run(std::int64_t k) {
  for (std::size_t l = 0; l < lane_.size(); ++l) go_on(l, k);
  for (;;) {
    int ticks = std::numeric_limits<int>::max();
    for (const Lane& lane : lane_) {
      if (lane.under_way > 0) ticks = std::min(ticks, lane.left);
    }
    if (ticks == std::numeric_limits<int>::max()) return;
    (drifts_ ? rotate_and_push : rotate)(oscillators_.data(), oscillators_.size(), ticks);
    for (std::size_t l = 0; l < lane_.size(); ++l) {
      Lane& lane = lane_[l];
      if (lane.under_way == 0) continue;
      lane.left -= ticks;
      if (lane.left > 0) continue;
      fetch(l, k);
      go_on(l, k);
    }
  }
}

// Moves the lane's replica to the next ticks that the vectors can do, or to the end. Lanes may be
// at different ticks.
void ReplicaSweep::go_on(std::size_t l, std::int64_t end) {
  Lane& lane = lane_[l];
  ReplicaState& state = lane.state;
  end = std::min(end, lane.ticks);
  while (state.tick < end) {
    const TickedFlight& flight = lane.replica->flight();
    if (state.chi == 0 && !flight.driven() && !flight.sampled()) {
      const std::int64_t until = std::min(end, lane.event_tick - 1);
      const auto plain =
          std::min<std::int64_t>(until - state.tick, TickedFlight::plain_ticks(state.anchor));
      if (plain > 0) {
        lane.under_way = lane.left = static_cast<int>(plain);
        put(l);
        return;
      }
    }
    const std::int64_t next = state.tick + 1;
    const std::size_t taken = next < lane.event_tick ? 0 : due(lane.events, next);
    lane.replica->tick(lane.events.first(taken), state);
    if (taken == 0) continue;
    lane.events = lane.events.subspan(taken);
    find_event_tick(lane);
  }
  rest(l);
}

// Number of leading events that take effect up to tick k.
std::size_t ReplicaSweep::due(std::span<const ContactEvent> events, std::int64_t k) const {
  const double t = tick_instant(k, h_).hi;
  std::size_t count = 0;
  while (count < events.size() && events[count].t <= t) ++count;
  return count;
}

void ReplicaSweep::find_event_tick(Lane& lane) const {
  lane.event_tick = max_tick;
  if (lane.events.empty()) return;
  const double t = lane.events.front().t;
  const std::int64_t k = last_tick(t, h_);
  lane.event_tick = tick_instant(k, h_).hi < t ? k + 1 : k;
}

void ReplicaSweep::put(std::size_t l) {
  const Motion& motion = lane_[l].state.motion;
  const TickedFlight& flight = lane_[l].replica->flight();
  for (std::size_t i = 0; i < oscillators_.size(); ++i) {
    oscillators_[i].z[l] = motion.x.z[index(i)];
    oscillators_[i].v[l] = motion.x.v[index(i)];
  }
  if (!flight.drifts()) return;
  for (std::size_t i = 0; i < oscillators_.size(); ++i) {
    oscillators_[i].z_push[l] = flight.table().z_alpha[index(i)] * motion.alpha[index(i)];
    oscillators_[i].v_push[l] = flight.table().v_alpha[index(i)] * motion.alpha[index(i)];
  }
}

void ReplicaSweep::fetch(std::size_t l, std::int64_t end) {
  Lane& lane = lane_[l];
  Motion& motion = lane.state.motion;
  lane.state.tick += lane.under_way;
  lane.state.anchor.ticks_since += static_cast<unsigned>(lane.under_way);
  lane.under_way = 0;
  motion.t = no_instant;
  // The exact step starts from the anchor and does not need the motion.
  const std::int64_t next = lane.state.tick + 1;
  const bool from_anchor = TickedFlight::plain_ticks(lane.state.anchor) == 0 &&
                           next < lane.event_tick && next <= std::min(end, lane.ticks);
  if (from_anchor) return;
  for (std::size_t i = 0; i < oscillators_.size(); ++i) {
    motion.x.z[index(i)] = oscillators_[i].z[l];
    motion.x.v[index(i)] = oscillators_[i].v[l];
  }
}

// A finished lane is set to zero, where values neither grow nor become denormal. Adding -0 changes
// no number; adding +0 would change -0.
void ReplicaSweep::rest(std::size_t l) {
  lane_[l].under_way = 0;
  for (Oscillator& x : oscillators_) {
    x.z[l] = x.v[l] = 0.0;
    x.z_push[l] = x.v_push[l] = -0.0;
  }
}

}  // namespace sprag
