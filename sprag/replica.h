// The replica: the machine with switched kinematic constraints (one-way clutches), eq. (4) of
// Baumann & Leine 2014, driven by the master's contact events alone. While chi_i = 1 gamma_i >= 0
// is enforced: the clutch locks when gamma_i falls to zero and unlocks when its force would turn
// negative. An event takes effect at its own time, inside a tick; between events the flow is exact,
// so the tick h is a sampling interval and no source of error.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/bound/error_bound.h"
#include "sprag/detail/estimates/confidence.h"
#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/estimates/innovation.h"
#include "sprag/detail/mechanics/contact_solver.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/replica/ticked_flight.h"
#include "sprag/scene.h"

namespace sprag {

/// Everything that changes, at tick `tick`. Copies between states of one replica do not allocate.
struct ReplicaState {
  std::int64_t tick = 0;
  ContactSet chi = 0;
  Motion motion;  ///< at the tick; t is no_instant behind a tick of free flight
  TickedFlight::Anchor anchor;
  /// Closed contacts without a force of their own: their directions depend on those of the locked
  /// ones, or nothing satisfies them beside these.
  ContactSet idle = 0;
  Redundancy redundancy;
  std::int64_t refused_impacts = 0;  ///< contradictory contacts: no motion satisfies them all
  ErrorBoundState error_bound;       ///< since the start
  Innovation innovation;
};

class Replica {
 public:
  using State = ReplicaState;

  /// Tick h > 0. Builds the flows of the locked sets that it can foresee. Throws ModelError.
  Replica(Model model, double h);
  Replica(const Scene& scene, double h) : Replica(scene.model, h) {}
  /// The same with flows that others use as well.
  Replica(std::shared_ptr<Flows> flows, double h);
  Replica(const Replica&) = delete;
  Replica& operator=(const Replica&) = delete;

  /// Puts the replica at (q, u) with chi at tick k. May allocate.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, ReplicaState& state);

  /// Moves to the next tick, through `events`: those after the present tick, up to and including
  /// the next, in order. Records of one instant are one impact. Does not allocate once the locked
  /// sets that occur have been met.
  void tick(std::span<const ContactEvent> events, ReplicaState& state) {
    if (events.empty() && state.chi == 0) {
      ++state.tick;
      flight_.step(state.tick, state.motion, state.anchor);
    } else {
      tick_through(events, state);
    }
  }

  /// Moves through up to n >= 0 ticks of free flight without events, of which note() would say
  /// nothing new, as tick() does one by one; returns how many. Does not allocate.
  std::int64_t coast(std::int64_t n, ReplicaState& state) const {
    if (state.chi != 0) return 0;
    for (const std::int64_t last = state.tick + n; state.tick < last;) {
      ++state.tick;
      flight_.step(state.tick, state.motion, state.anchor);
    }
    return n;
  }

  /// A tick in parts, for who looks at each instant in it: opened, through the events of one
  /// instant after the other, closed.
  void open_tick(ReplicaState& state) const;
  void take(std::span<const ContactEvent> of_one_instant, ReplicaState& state);
  void close_tick(ReplicaState& state);

  /// Moves to an instant t, not before the motion's, without events. Of the tick that is open.
  void move(Instant t, ReplicaState& state) { advance(t, state); }

  /// Applies events of the present instant without moving: those that a start begins with.
  void apply(std::span<const ContactEvent> events, ReplicaState& state);

  /// q and u at the present tick, f entries each.
  void output(const ReplicaState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  /// Room for what confidence() says, without allocating: a bound on V (error_bound()), how far the
  /// contact that closed last was from closing in the estimate, and contacts it could not hold.
  Confidence no_confidence() const;
  void note(const ReplicaState& state, Confidence& confidence) const;  ///< all but the bound
  void confidence(const ReplicaState& state, double initial, Confidence& confidence);

  /// Records each event from now on, of a replica of which one state alone is moved and never back;
  /// null: none. Of the error nothing is known.
  void record_in(ImpactRecorder* recorder) { recorder_ = recorder; }

  double h() const { return h_; }
  const Flows& flows() const { return *flows_; }
  Flows& flows() { return *flows_; }
  const TickedFlight& flight() const { return flight_; }

  /// Upper bound on the error energy V at the tick, if it was at most `initial` at the start and
  /// the events are exact and complete; +infinity where the machine's law is not monotone.
  double error_bound(const ReplicaState& state, double initial);

 private:
  void tick_through(std::span<const ContactEvent> events, ReplicaState& state);
  void advance(Instant t, ReplicaState& state);
  void fly(Instant t, Motion& motion);
  void take_here(std::span<const ContactEvent> events, ReplicaState& state);
  void note_innovation(ContactSet closing, ReplicaState& state) const;
  void apply_group(std::span<const ContactEvent> events, ReplicaState& state);
  void release(ContactSet leaving, ContactSet unlocking, ReplicaState& state);
  void note_idle(ContactSet closing, ContactSet unsatisfied, ReplicaState& state) const;

  std::shared_ptr<Flows> flows_;
  double h_;
  ContactSolver solver_;
  ErrorBound error_bound_;
  EventSearch search_;
  TickedFlight flight_;
  ImpactRecorder* recorder_ = nullptr;
  Eigen::VectorXd q_, u_;   // scratch of a record
  std::vector<int> order_;  // per contact: leading derivatives of its watched signal that vanish
  std::vector<double> epsilon_;
  std::vector<Watch> watches_;
};

}  // namespace sprag
