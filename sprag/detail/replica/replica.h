// The replica: the machine with switched kinematic constraints (one-way clutches), eq. (4) of
// Baumann & Leine 2014, driven by the master's contact events alone.
//
// While chi_i = 1 the clutch enforces gamma_i >= 0. It locks when gamma_i falls to zero and unlocks
// when its force would become negative. An event takes effect at its own time inside a tick. The
// flow between events is exact, so that the tick h samples the motion and causes no error.
//
// Contacts are counted from 0.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/detail/estimates/impact_record.h"
#include "sprag/detail/mechanics/contact_solver.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/replica/ticked_flight.h"
#include "sprag/scene.h"

namespace sprag {

/// Everything of a replica that changes, at tick `tick`. Copies between states of one replica do
/// not allocate.
struct ReplicaState {
  std::int64_t tick = 0;        ///< number of the tick
  ContactSet chi = 0;           ///< closed contacts
  Motion motion;                ///< at the tick; t is no_instant after a tick of free flight
  TickedFlight::Anchor anchor;  ///< start of the present free flight
  /// Closed contacts without a force of their own. Their directions depend on those of locked
  /// contacts, or no motion satisfies them together with the locked contacts.
  ContactSet idle = 0;
  Redundancy redundancy;             ///< closings of contacts that depend on locked ones
  std::int64_t refused_impacts = 0;  ///< contradictory contacts: no motion satisfies all of them
  Innovation innovation;             ///< at the last closing
};

/// Exact replica of one machine, f coordinates. Follows the Estimator interface (estimator.h).
class Replica {
 public:
  using State = ReplicaState;

  /// Builds the flows of the locked sets that can be foreseen; tick h > 0 [s]. Throws ModelError if
  /// the machine has no exact flow.
  Replica(Model model, double h);
  Replica(const Scene& scene, double h) : Replica(scene.model, h) {}
  /// The same with shared flows.
  Replica(std::shared_ptr<Flows> flows, double h);
  Replica(const Replica&) = delete;
  Replica& operator=(const Replica&) = delete;

  /// Puts a state at (q, u), with the contacts chi closed, at tick k. May allocate.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, ReplicaState& state);

  /// Moves to the next tick through the events in (present tick, next tick], in order; those of one
  /// instant are one impact. Does not allocate once the locked sets that occur have been met.
  void tick(std::span<const ContactEvent> events, ReplicaState& state) {
    if (events.empty() && state.chi == 0) {
      ++state.tick;
      flight_.step(state.tick, state.motion, state.anchor);
    } else {
      tick_through(events, state);
    }
  }

  /// Moves through up to n >= 0 ticks of free flight without events, with the same result as
  /// tick(). note() has nothing new at these ticks. Does not allocate. Returns the number of ticks
  /// moved; 0 while a contact is closed.
  std::int64_t coast(std::int64_t n, ReplicaState& state) const {
    if (state.chi != 0) return 0;
    for (const std::int64_t last = state.tick + n; state.tick < last;) {
      ++state.tick;
      flight_.step_modes(state.tick, state.motion, state.anchor);
    }
    if (n > 0 && flight_.sampled()) flight_.set_inputs(state.tick, state.motion);
    return n;
  }

  /// A tick that is taken instant by instant: open_tick(), take() for the events of each instant,
  /// close_tick().
  void open_tick(ReplicaState& state) const;
  /// Moves to an instant of the open tick and applies its events.
  void take(std::span<const ContactEvent> of_one_instant, ReplicaState& state);
  /// Moves to the end of the open tick.
  void close_tick(ReplicaState& state);

  /// Moves to an instant of the open tick, not before the motion's time, through the clutches' own
  /// switchings and without events.
  void advance(Instant t, ReplicaState& state);

  /// Applies events of the present instant without moving, as at a start.
  void apply(std::span<const ContactEvent> events, ReplicaState& state);

  /// q and u at the present tick, f entries each.
  void output(const ReplicaState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  /// A Confidence with room for the results of note(), which then does not allocate.
  Confidence no_confidence() const;
  /// Fills in all fields except the bound: the innovation at the last closing, redundant and
  /// refused contacts.
  void note(const ReplicaState& state, Confidence& confidence) const;

  /// Records each event from now on, with unknown error; null: no longer. Only one state of the
  /// replica may be moved then, and never back.
  void record_in(ImpactRecorder* recorder) { recorder_ = recorder; }

  double h() const { return h_; }  ///< tick [s]
  const Flows& flows() const { return *flows_; }
  Flows& flows() { return *flows_; }

 private:
  void tick_through(std::span<const ContactEvent> events, ReplicaState& state);
  void fly(Instant t, Motion& motion);
  void take_here(std::span<const ContactEvent> events, ReplicaState& state);
  void note_innovation(ContactSet closing, ReplicaState& state) const;
  void apply_group(std::span<const ContactEvent> events, ReplicaState& state);
  void release(ContactSet leaving, ContactSet unlocking, ReplicaState& state);
  void note_idle(ContactSet closing, ContactSet unsatisfied, ReplicaState& state) const;

  std::shared_ptr<Flows> flows_;
  double h_;
  ContactSolver solver_;
  EventSearch search_;
  TickedFlight flight_;
  ImpactRecorder* recorder_ = nullptr;
  Eigen::VectorXd q_, u_;  // scratch of recording
  // Per contact: number of leading derivatives of its watched signal that are zero.
  std::vector<int> order_;
  std::vector<double> epsilon_;
  std::vector<Watch> watches_;
};

}  // namespace sprag
