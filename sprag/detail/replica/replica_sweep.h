// A sweep: up to eight replicas (replica.h) of machines of one structure, side by side in the lanes
// of the processor's vectors, for studies of many runs. Parameters, starts, events and lengths may
// differ from lane to lane.
//
// In free flight a tick is z+ = zz z + zv v + za, v+ = vz z + vv v + va for each oscillator; the
// lanes of one oscillator lie next to each other, and many ticks are done without leaving the
// registers. Whatever else a tick holds (an event, a locked contact, the exact step from the
// anchor, a force near resonance) is done by the lane's own replica. Each lane goes through the
// operations of a single replica in their order, none of them fused: every state is that of a
// Replica that ticks alone, bit for bit.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/replica.h"

namespace sprag {

class ReplicaSweep {
 public:
  static constexpr std::size_t lanes = 8;

  struct Run {
    std::shared_ptr<Flows> flows;
    State start;  ///< at tick 0
    /// In order. Each takes effect in the first tick whose rounded time is not before it, those of
    /// the start and before it at tick 0. What they are must outlive the sweep.
    std::span<const ContactEvent> events;
    ContactSet chi = 0;             ///< at the start
    std::int64_t ticks = max_tick;  ///< the run stands still at this tick
  };

  /// One to eight runs, tick h > 0. Throws ModelError: other counts, machines of more than one
  /// structure, and what Replica throws.
  ReplicaSweep(std::span<const Run> runs, double h);

  /// Whether two machines have as many coordinates, contacts and frequencies.
  static bool of_one_structure(const Flows& a, const Flows& b);

  /// Every run to tick k, or to its own end before. k does not fall. Does not allocate once the
  /// locked sets that occur have been met.
  void run(std::int64_t k);

  std::size_t size() const { return lane_.size(); }
  const ReplicaState& state(std::size_t run) const { return lane_[run].state; }
  const Replica& replica(std::size_t run) const { return *lane_[run].replica; }
  /// q and u of a run, f entries each.
  void output(std::size_t run, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u) const {
    lane_[run].replica->output(lane_[run].state, q, u);
  }

  /// One oscillator of all lanes: state and step.
  struct alignas(64) Oscillator {
    using Lanes = std::array<double, lanes>;
    Lanes z, v, zz, zv, vz, vv, z_push, v_push;
  };

 private:
  struct Lane {
    std::unique_ptr<Replica> replica;
    ReplicaState state;                    // without the ticks that are under way in the vectors
    std::span<const ContactEvent> events;  // still to come
    std::int64_t event_tick = max_tick;    // of the first of them
    std::int64_t ticks = max_tick;
    int under_way = 0;  // ticks in the vectors up to where the replica goes on; 0: stands still
    int left = 0;       // of them
  };

  void go_on(std::size_t l, std::int64_t end);
  std::size_t due(std::span<const ContactEvent> events, std::int64_t k) const;
  void find_event_tick(Lane& lane) const;
  void put(std::size_t l);
  void fetch(std::size_t l, std::int64_t end);
  void rest(std::size_t l);

  double h_;
  bool drifts_ = false;  // a constant force pushes in some lane
  std::vector<Lane> lane_;
  std::vector<Oscillator> oscillators_;
};

}  // namespace sprag
