// Recorded events as identification takes them: stretches of impacts of single contacts, others
// being held closed or all being open between them.
#pragma once

#include <bit>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/event_gap.h"

namespace sprag {

/// What happens on the way to an impact, at a time that is taken as it is: a bounce that comes too
/// soon after another to be told from it (bounces.h), a contact that closes at the end of a
/// chatter, or some that open where their forces have come to zero, which their times change to
/// second order only.
struct Passage {
  double t = 0.0;
  int contact = -1;        ///< that is hit, from 0; -1: none is
  ContactSet staying = 0;  ///< closed from then on

  friend bool operator==(const Passage&, const Passage&) = default;
};

struct Impact {
  double t = 0.0;
  int contact = 0;                   ///< from 0
  bool timed = true;                 ///< false: it was missed, and t is a guess
  std::size_t event = 0;             ///< its number among the record's events
  ContactSet held = 0;               ///< closed until then
  ContactSet staying = 0;            ///< closed from then on; `contact` among them closes to stay
  std::vector<Passage> passed = {};  ///< since the impact before it, or the start

  friend bool operator==(const Impact&, const Impact&) = default;
};

/// Impacts one after the other from a state of its own at `start`, which is not after the first.
struct Stretch {
  double start = 0.0;
  std::vector<Impact> impacts;
  /// Contacts whose gaps and gap velocities are zero at `start`: they were closed until then.
  ContactSet closed = 0;
  /// Those of them that stay so.
  ContactSet held = 0;

  std::size_t size() const { return impacts.size(); }
  /// Equations that those contacts are for the start.
  std::size_t of_start() const { return 2 * static_cast<std::size_t>(std::popcount(closed)); }
  /// Equations in all.
  std::size_t equations() const { return size() + of_start(); }

  friend bool operator==(const Stretch&, const Stretch&) = default;
};

using Stretches = std::vector<Stretch>;

/// Whether an impact of a contact is one that a path can be led through, where `held` are closed
/// until then and `staying` from then on.
using CanFollow = std::function<bool(int contact, ContactSet held, ContactSet staying)>;

struct RecordSettings {
  double begins = 0.0;    ///< all events since then are known
  ContactSet closed = 0;  ///< there
  /// Where events may be missing, in order and apart: one that begins and ends at one time is none.
  std::span<const EventGap> gaps = {};
  double close = 0.0;         ///< impacts that are nearer to each other are not told apart
  std::size_t longest = 150;  ///< a longer stretch is cut
  /// Of contacts that are held; none: it is cut where one closes to stay.
  CanFollow can_follow = {};
  bool exact = false;  ///< bounces that are closer than `close` come when they are said to
};

/// Cuts at gaps, where several contacts are hit at one instant, where impacts are closer than
/// `close`, unless they are the last bounces of a chatter or exact, and where a path cannot follow;
/// stretches with fewer equations than `fewest` are left out. A contact that closed to stay and
/// opens, no event being within `close`, has no gap and no gap velocity there; not one that is
/// closed at `begins`, where a machine may be inside.
Stretches cut(std::span<const ContactEvent> events, const RecordSettings& settings,
              std::size_t fewest);

/// One after the other, what impact k of a stretch comes by: visit(from, to, held, passage), the
/// passage being that at `to`, or null where it is the impact itself.
template <typename Visit>
void for_each_leg(const Stretch& stretch, std::size_t k, Visit visit) {
  double t = k > 0 ? stretch.impacts[k - 1].t : stretch.start;
  ContactSet held = k > 0 ? stretch.impacts[k - 1].staying : stretch.held;
  const Impact& impact = stretch.impacts[k];
  for (const Passage& passage : impact.passed) {
    visit(t, passage.t, held, &passage);
    t = passage.t;
    held = passage.staying;
  }
  visit(t, impact.t, held, static_cast<const Passage*>(nullptr));
}

/// Impacts in all, and equations.
std::size_t count(const Stretches& stretches);
std::size_t equations(const Stretches& stretches);

/// The impacts number first to first + size - 1 of all; one that is cut off in front begins at its
/// first impact.
Stretches part(const Stretches& stretches, std::size_t first, std::size_t size);

/// The time between neighbouring impacts: half of the record is in intervals up to this one, so
/// that the many short ones of a chatter do not count for much. 0 where there are none.
double usual_interval(const Stretches& stretches);

}  // namespace sprag
