// The master: the machine with geometric unilateral constraints, eq. (5) of Baumann & Leine 2014,
// simulated event by event with exact flows. It produces the contact events an observer lives on.
//
// An isolated impact is a pulse with the contact's restitution. A bounce sequence whose rest
// 2 gamma+ / (|g''| (1 - epsilon)) is shorter than Model::chatter_time is completed: the contact
// closes to stay, with restitution 0, at the instant where the sequence would have ended. Contacts
// that throw the machine to and fro between them, as in a wedge, have no such formula: they are
// completed together once 32 impacts take less than 16 chatter_time. Closed contacts that go on to
// throw each other off, each for longer than chatter_time, are held together (holds_together()).
// A closed contact opens when its force would turn negative.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/contact_solver.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/error.h"

namespace sprag {

/// A gap below this share of its terms is closed.
inline constexpr double touching = 1e-12;
/// Bounces that are shorter than this share of the time cannot be told apart.
inline constexpr double resolvable = 1e-14;

/// The simulation cannot go on; what() says when and why.
struct SimulationError : Error {
  using Error::Error;
};

class Master {
 public:
  /// Starts at t = 0. A contact with g < 0 stays closed (gamma >= 0) until g rises through zero;
  /// the scene reader decides whether such a start is allowed. Throws ModelError.
  Master(Model model, const State& start);
  /// Goes on from (q, u) at t >= 0 [s], the contacts `closed` held at g = 0. Their closing is told
  /// once more, at t. `flows` must outlive this.
  Master(const Flows& flows, const State& start, double t, ContactSet closed);
  Master(const Master&) = delete;
  Master& operator=(const Master&) = delete;

  /// Simulates every event up to and including t and appends them to `events` in order. Gives up
  /// before t, with false, after `enough` of them; call again to go on. Throws SimulationError (no
  /// progress, dependent directions) or Interrupted (interrupt.h); events found until then are
  /// kept, and the master is not to be advanced any more.
  bool advance(Instant t, std::vector<ContactEvent>& events,
               std::size_t enough = std::numeric_limits<std::size_t>::max());

  /// Takes the next instant at which anything happens, told or not, if it is not after t; whether
  /// there was one. The first call takes what happens at the start as well. Throws as advance().
  bool advance_once(Instant t, std::vector<ContactEvent>& events);

  /// State at t, right-continuous; t between the last event and the next one, as after advance(t).
  /// q and u have f entries each.
  void state(Instant t, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u);

  /// Time of the next event if it is known already, else infinity. It is known at the latest when
  /// advance() comes close to it.
  double next_event() const;

  /// chi at the time of the last advance().
  ContactSet closed() const { return closed_; }
  const Flows& flows() const { return flows_; }
  /// Where it is behind the last instant at which anything happened; its flow is the present one.
  const Motion& motion() const { return motion_; }

  /// Work done so far.
  long impacts() const { return impacts_; }
  long expansions() const { return search_.expansions(); }

 private:
  enum WatchKind { gap_falls, gap_rises, velocity_falls, force_falls };

  // What happens at one instant.
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

  std::unique_ptr<const Flows> own_flows_;  // null: another's
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
  std::vector<int> order_;  // per contact: leading derivatives of its watched signal that vanish
  std::vector<double> completion_;  // per contact: time at which its chatter ends, or infinity
  std::vector<double> closed_at_;   // per contact: time at which it closed to stay last
  std::array<Impact, 32> recent_;   // ring of the last impacts
  // Brief contacts since brief_since_ [s], closely one after the other; restarted by a longer
  // pause.
  int brief_contacts_ = 0;
  double brief_since_ = 0.0;
  double machine_time_ = 0.0;    // time_scale() of the machine [s]; 0 until it is needed
  std::vector<double> epsilon_;  // scratch
  std::vector<Watch> watches_;   // scratch
  bool started_ = false;
  long impacts_ = 0;
  int events_since_ = 0;  // since_ [s]
  double since_ = 0.0;
};

}  // namespace sprag
