// Sweep: up to eight replicas (replica.h) of machines with one structure in the lanes of the
// processor's vectors, for studies of many runs. Parameters, starts, events and lengths may differ
// between lanes.
//
// In free flight a tick is z+ = zz z + zv v + za, v+ = vz z + vv v + va for each oscillator. The
// lanes of one oscillator are adjacent in memory, and many ticks are done in registers. The lane's
// own replica does all other ticks: with an event, a locked contact, the exact step from the
// anchor, or a force near resonance. Each lane performs the operations of a single replica in the
// same order, without fused operations, so that every state equals that of a Replica bit by bit.
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
    /// In order of time; must outlive the sweep. Each takes effect in the first tick whose rounded
    /// time is not before it; events at or before the start do at tick 0.
    std::span<const ContactEvent> events;
    ContactSet chi = 0;             ///< at the start
    std::int64_t ticks = max_tick;  ///< the run ends at this tick
  };

  /// One to eight runs, tick h > 0. Throws ModelError for another number of runs, for machines of
  /// different structures, and as Replica does.
  ReplicaSweep(std::span<const Run> runs, double h);

  /// Whether two machines have the same numbers of coordinates, contacts and frequencies.
  static bool of_one_structure(const Flows& a, const Flows& b);

  /// Moves every run to tick k, or to its own earlier end. k must not decrease. Does not allocate
  /// once the locked sets that occur have been met.
  void run(std::int64_t k);

  std::size_t size() const { return lane_.size(); }
  const ReplicaState& state(std::size_t run) const { return lane_[run].state; }
  const Replica& replica(std::size_t run) const { return *lane_[run].replica; }
  /// q and u of a run, f entries each.
  void output(std::size_t run, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u) const {
    lane_[run].replica->output(lane_[run].state, q, u);
  }

  /// State and step of one oscillator in all lanes.
  struct alignas(64) Oscillator {
    using Lanes = std::array<double, lanes>;
    Lanes z, v, zz, zv, vz, vv, z_push, v_push;
  };

 private:
  struct Lane {
    std::unique_ptr<Replica> replica;
    ReplicaState state;                    // without the ticks in progress in the vectors
    std::span<const ContactEvent> events;  // later events
    std::int64_t event_tick = max_tick;    // tick of the first later event
    std::int64_t ticks = max_tick;
    int under_way = 0;  // ticks that the vectors do before the replica continues; 0: finished
    int left = 0;       // remaining ticks in the vectors
  };

  void go_on(std::size_t l, std::int64_t end);
  std::size_t due(std::span<const ContactEvent> events, std::int64_t k) const;
  void find_event_tick(Lane& lane) const;
  void put(std::size_t l);
  void fetch(std::size_t l, std::int64_t end);
  void rest(std::size_t l);

  double h_;
  bool drifts_ = false;  // some lane has a constant force
  std::vector<Lane> lane_;
  std::vector<Oscillator> oscillators_;
};

}  // namespace sprag
