/// \file
/// \brief The master: simulates the machine with geometric unilateral constraints, eq. (5) of
/// Baumann & Leine 2014, event by event with exact flows, and produces its contact events.
///
/// - Isolated impact: a pulse with the contact's restitution.
/// - Chatter: a bounce sequence whose remainder 2 gamma+ / (|g''| (1 - epsilon)) is shorter than
///   Model::chatter_time is completed. The contact closes to stay, with restitution 0, at the
///   accumulation point.
/// - Joint chatter: contacts that throw the machine to and fro between them, as in a wedge, have no
///   such formula. They are completed together after 32 impacts in less than 16 chatter_time.
/// - Closed contacts that release each other repeatedly, each for longer than chatter_time, are
///   held together (holds_together()).
/// - Release: a closed contact opens when its force would become negative.
///
/// Contacts are counted from 0.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/contact_solver.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/simulate.h"

namespace sprag {

/// \brief A gap below this share of its terms counts as closed.
inline constexpr double touching = 1e-12;
/// \brief Bounces shorter than this share of the time t cannot be distinguished in t.
inline constexpr double resolvable = 1e-14;

/// \brief Simulates one machine from event to event.
class Master {
 public:
  /// \brief Starts at t = 0.
  ///
  /// A contact with g < 0 stays closed (gamma >= 0) until g rises through zero. The scene reader
  /// decides whether such a start is allowed.
  /// \param model the machine, f coordinates.
  /// \param start state at t = 0.
  /// \throws ModelError if the machine has no exact flow.
  Master(Model model, const State& start);
  /// \brief Continues from a state at time t. The closing of the closed contacts is reported again,
  /// at t.
  /// \param flows flows of the machine; must outlive this.
  /// \param start state at t.
  /// \param t time, >= 0 [s].
  /// \param closed contacts that are held at g = 0.
  Master(const Flows& flows, const State& start, double t, ContactSet closed);
  Master(const Master&) = delete;
  Master& operator=(const Master&) = delete;

  /// \brief Simulates up to and including t.
  ///
  /// After an exception the events found before it are kept, and the master must not be advanced
  /// again.
  /// \param t end.
  /// \param events receives the new events, appended in order.
  /// \param enough number of new events after which it stops before t.
  /// \param stop token by which another thread or a signal handler cancels the computation.
  /// \return false if it stopped before t; call again to continue.
  /// \throws SimulationError for no progress of time, or linearly dependent directions of closed
  /// contacts.
  /// \throws Interrupted if `stop` was requested.
  bool advance(Instant t, std::vector<ContactEvent>& events,
               std::size_t enough = std::numeric_limits<std::size_t>::max(),
               std::stop_token stop = {});

  /// \brief Moves to the next instant at which anything changes, also without an event, if it is
  /// not after t. The first call also handles the start.
  /// \param t end.
  /// \param events receives the new events, appended in order.
  /// \return whether there was such an instant.
  /// \throws SimulationError as advance() does.
  /// \throws Interrupted as advance() does.
  bool advance_once(Instant t, std::vector<ContactEvent>& events);

  /// \brief State at t, right-continuous.
  /// \param t time between the last and the next event, as after advance(t).
  /// \param q receives the coordinates, f entries.
  /// \param u receives the velocities, f entries.
  void state(Instant t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u);

  /// \brief Time of the next event, if it is known already. advance() knows it at the latest when
  /// it comes close to it.
  /// \return time [s], else infinity.
  double next_event() const;

  /// \brief Closed contacts at the time of the last advance().
  /// \return chi.
  ContactSet closed() const { return closed_; }
  /// \brief Flows of the machine.
  /// \return the flows.
  const Flows& flows() const { return flows_; }
  /// \brief Motion just after the last instant at which anything changed, on the present flow.
  /// \return the motion.
  const Motion& motion() const { return motion_; }

  /// \brief Number of impacts so far.
  /// \return the number.
  long impacts() const { return impacts_; }
  /// \brief Number of series expansions of the event search so far.
  /// \return the number.
  long expansions() const { return search_.expansions(); }

 private:
  enum WatchKind { gap_falls, gap_rises, velocity_falls, force_falls };

  // Changes at one instant.
  struct Due {
    ContactSet closing = 0;    // gaps fall to zero
    ContactSet completed = 0;  // chatters end
    ContactSet releasing = 0;  // forces fall to zero
    ContactSet surfacing = 0;  // gaps of penetrating contacts rise to zero
    ContactSet arrested = 0;   // velocities of penetrating contacts fall to zero
  };
  struct Impact {
    double t = -std::numeric_limits<double>::infinity();
    ContactSet closing = 0;
  };

  void start_contacts(std::vector<ContactEvent>& events);
  void watch();
  bool find_next(Instant t, double& event);
  void take_next(double event, std::vector<ContactEvent>& events);
  void begin(std::vector<ContactEvent>& events);
  void check_progress(double event);
  Due take_due(bool from_search);
  void take_event(bool from_search, std::vector<ContactEvent>& events);
  void surface(ContactSet surfacing, std::vector<ContactEvent>& events);
  void release(ContactSet releasing, std::vector<ContactEvent>& events);
  void arrest(ContactSet arrested);
  void close(ContactSet closing, ContactSet to_stay, std::vector<ContactEvent>& events);
  double restitution_now(int i) const;
  Collision collide(ContactSet closing, ContactSet& staying);
  void foresee_completion(int contact, double gamma);
  ContactSet touching_beside(ContactSet contacts) const;
  bool touches(int contact) const;
  double shortest_time() const;
  double shortest_chatter() const;
  ContactSet wedged(ContactSet closing);
  ContactSet hardly_parted(ContactSet contacts, const Collision& collision);
  bool is_brief(double duration);
  bool in_brief_contacts();
  void count_brief_contact();
  bool holds_together();
  ContactSet recently_active() const;
  void record(int contact, ContactEventKind kind, std::vector<ContactEvent>& events);
  [[noreturn]] void fail(const std::string& what) const;
  double now() const { return motion_.t.hi; }

  Master(std::unique_ptr<const Flows> own, const State& start);

  std::unique_ptr<const Flows> own_flows_;  // null: flows_ belongs to the caller
  const Flows& flows_;
  ContactSolver solver_;
  EventSearch search_;
  Motion motion_;  // at the last event
  Motion here_;    // scratch for state()
  Motion before_;  // scratch for collide()
  State start_;
  ContactSet held_at_start_ = 0;
  ContactSet closed_ = 0;       // chi
  ContactSet penetrating_ = 0;  // closed since the start, g < 0
  std::vector<int>
      order_;  // per contact: number of leading derivatives of its watched signal that are zero
  std::vector<double> completion_;  // per contact: time at which its chatter ends, or infinity
  std::vector<double> closed_at_;   // per contact: time at which it closed to stay last
  std::array<Impact, 32> recent_;   // ring buffer of the last impacts
  // Number of brief contacts in close succession since brief_since_ [s]. A longer pause resets it.
  int brief_contacts_ = 0;
  double brief_since_ = 0.0;
  double machine_time_ = 0.0;    // time_scale() of the machine [s]; 0: not computed yet
  std::vector<double> epsilon_;  // scratch
  std::vector<Watch> watches_;   // scratch
  bool started_ = false;
  long impacts_ = 0;
  int events_since_ = 0;  // number of events since since_ [s]
  double since_ = 0.0;
};

}  // namespace sprag
