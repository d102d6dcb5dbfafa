/// \file
/// \brief The replica: the machine with switched kinematic constraints (one-way clutches), eq. (4)
/// of Baumann & Leine 2014, driven by the master's contact events alone.
///
/// While chi_i = 1 the clutch enforces gamma_i >= 0. It locks when gamma_i falls to zero and
/// unlocks when its force would become negative. An event takes effect at its own time inside a
/// tick. The flow between events is exact, so that the tick h samples the motion and causes no
/// error.
///
/// Contacts are counted from 0.
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

/// \brief Everything of a replica that changes, at tick `tick`. Copies between states of one
/// replica do not allocate.
struct ReplicaState {
  std::int64_t tick = 0;        ///< number of the tick
  ContactSet chi = 0;           ///< closed contacts
  Motion motion;                ///< at the tick; t is no_instant after a tick of free flight
  TickedFlight::Anchor anchor;  ///< start of the present free flight
  /// \brief Closed contacts without a force of their own. Their directions depend on those of
  /// locked contacts, or no motion satisfies them together with the locked contacts.
  ContactSet idle = 0;
  Redundancy redundancy;             ///< closings of contacts that depend on locked ones
  std::int64_t refused_impacts = 0;  ///< contradictory contacts: no motion satisfies all of them
  Innovation innovation;             ///< at the last closing
};

/// \brief Exact replica of one machine, f coordinates. Follows the Estimator interface
/// (estimator.h).
class Replica {
 public:
  /// \brief Everything that changes.
  using State = ReplicaState;

  /// \brief Builds the flows of the locked sets that can be foreseen.
  /// \param model the machine.
  /// \param h tick, > 0 [s].
  /// \throws ModelError if the machine has no exact flow.
  Replica(Model model, double h);
  /// \brief The same for the machine of a scene.
  /// \param scene the scene.
  /// \param h tick, > 0 [s].
  /// \throws ModelError if the machine has no exact flow.
  Replica(const Scene& scene, double h) : Replica(scene.model, h) {}
  /// \brief The same with shared flows.
  /// \param flows flows of the machine.
  /// \param h tick, > 0 [s].
  /// \throws ModelError if the machine has no exact flow.
  Replica(std::shared_ptr<Flows> flows, double h);
  Replica(const Replica&) = delete;
  Replica& operator=(const Replica&) = delete;

  /// \brief Puts a state at (q, u). May allocate.
  /// \param start q and u, f entries each.
  /// \param k number of the tick.
  /// \param chi closed contacts.
  /// \param state receives the state.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, ReplicaState& state);

  /// \brief Moves to the next tick. Does not allocate once the locked sets that occur have been
  /// met. \param events events in (present tick, next tick], in order; those of one instant are one
  /// impact.
  /// \param state state to move.
  void tick(std::span<const ContactEvent> events, ReplicaState& state) {
    if (events.empty() && state.chi == 0) {
      ++state.tick;
      flight_.step(state.tick, state.motion, state.anchor);
    } else {
      tick_through(events, state);
    }
  }

  /// \brief Moves through up to n ticks of free flight without events, with the same result as
  /// tick(). note() has nothing new at these ticks. Does not allocate.
  /// \param n number of ticks, >= 0.
  /// \param state state to move.
  /// \return number of ticks moved; 0 while a contact is closed.
  std::int64_t coast(std::int64_t n, ReplicaState& state) const {
    if (state.chi != 0) return 0;
    for (const std::int64_t last = state.tick + n; state.tick < last;) {
      ++state.tick;
      flight_.step_modes(state.tick, state.motion, state.anchor);
    }
    if (n > 0 && flight_.sampled()) flight_.set_inputs(state.tick, state.motion);
    return n;
  }

  /// \brief First part of a tick that is taken instant by instant: open_tick(), take() for the
  /// events of each instant, close_tick().
  /// \param state state to move.
  void open_tick(ReplicaState& state) const;
  /// \brief Moves to an instant of the open tick and applies its events.
  /// \param of_one_instant events of one time.
  /// \param state state to move.
  void take(std::span<const ContactEvent> of_one_instant, ReplicaState& state);
  /// \brief Moves to the end of the open tick.
  /// \param state state to move.
  void close_tick(ReplicaState& state);

  /// \brief Moves to an instant of the open tick, without events.
  /// \param t not before the motion's time.
  /// \param state state to move.
  void move(Instant t, ReplicaState& state) { advance(t, state); }

  /// \brief Applies events of the present instant without moving, as at a start.
  /// \param events events of one time.
  /// \param state state to change.
  void apply(std::span<const ContactEvent> events, ReplicaState& state);

  /// \brief q and u at the present tick.
  /// \param state the state.
  /// \param q receives the coordinates, f entries.
  /// \param u receives the velocities, f entries.
  void output(const ReplicaState& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  /// \brief Makes a Confidence with room for the results of note(), which then does not allocate.
  /// \return the Confidence.
  Confidence no_confidence() const;
  /// \brief Fills in all fields except the bound: the innovation at the last closing, redundant and
  /// refused contacts.
  /// \param state the state.
  /// \param confidence receives the fields.
  void note(const ReplicaState& state, Confidence& confidence) const;

  /// \brief Records each event from now on, with unknown error. Only one state of the replica may
  /// be moved then, and never back.
  /// \param recorder the recorder; null: stop recording.
  void record_in(ImpactRecorder* recorder) { recorder_ = recorder; }

  /// \brief Tick.
  /// \return h [s].
  double h() const { return h_; }
  /// \brief Flows of the machine.
  /// \return the flows.
  const Flows& flows() const { return *flows_; }
  /// \brief Flows of the machine.
  /// \return the flows.
  Flows& flows() { return *flows_; }
  /// \brief Free flight from tick to tick.
  /// \return the stepper.
  const TickedFlight& flight() const { return flight_; }

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
  EventSearch search_;
  TickedFlight flight_;
  ImpactRecorder* recorder_ = nullptr;
  Eigen::VectorXd q_, u_;  // scratch of recording
  std::vector<int>
      order_;  // per contact: number of leading derivatives of its watched signal that are zero
  std::vector<double> epsilon_;
  std::vector<Watch> watches_;
};

}  // namespace sprag
