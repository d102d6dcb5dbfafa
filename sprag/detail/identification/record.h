// Recorded events as input of an identification: stretches of impacts of single contacts. Between
// the impacts all contacts are open, or some are held closed.
#pragma once

#include <bit>
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/event_gap.h"

namespace sprag {

/// An event between two impacts whose recorded time is used as exact: a bounce that is too close to
/// another to be distinguished from it (bounces.h), a contact that closes at the end of a chatter,
/// or contacts that open. An opening is where the force is zero, so its time matters to second
/// order only.
struct Passage {
  double t = 0.0;
  int contact = -1;        ///< contact with an impact, from 0; -1: none
  ContactSet staying = 0;  ///< contacts closed after it

  friend bool operator==(const Passage&, const Passage&) = default;
};

struct Impact {
  double t = 0.0;
  int contact = 0;        ///< from 0
  bool timed = true;      ///< false: the impact has no event, and t is a guess
  std::size_t event = 0;  ///< number of its event in the record
  ContactSet held = 0;    ///< contacts closed before it
  /// Contacts closed after it; contains `contact` if it stays closed.
  ContactSet staying = 0;
  std::vector<Passage> passed = {};  ///< passages since the previous impact or the start

  friend bool operator==(const Impact&, const Impact&) = default;
};

/// Consecutive impacts from an unknown state at `start`, which is not later than the first impact.
struct Stretch {
  double start = 0.0;
  std::vector<Impact> impacts;
  /// Contacts with zero gap and gap velocity at `start`, because they were closed until then.
  ContactSet closed = 0;
  /// Those of `closed` that stay closed.
  ContactSet held = 0;

  std::size_t size() const { return impacts.size(); }
  /// Number of equations of `closed` for the start.
  std::size_t of_start() const { return 2 * static_cast<std::size_t>(std::popcount(closed)); }
  /// Number of all equations.
  std::size_t equations() const { return size() + of_start(); }

  friend bool operator==(const Stretch&, const Stretch&) = default;
};

using Stretches = std::vector<Stretch>;

/// Whether a path can be computed through an impact of the contact, with `held` closed before it
/// and `staying` after it.
using CanFollow = std::function<bool(int contact, ContactSet held, ContactSet staying)>;

struct RecordSettings {
  double begins = 0.0;    ///< all events after this time are known [s]
  ContactSet closed = 0;  ///< contacts closed at that time
  /// Intervals in which events may be missing, in order and disjoint. Intervals of length zero are
  /// ignored.
  std::span<const EventGap> gaps = {};
  double close = 0.0;         ///< impacts closer than this cannot be distinguished [s]
  std::size_t longest = 150;  ///< longest stretch, in impacts
  /// Decides about impacts with held contacts. Empty: stretches end where a contact stays closed.
  CanFollow can_follow = {};
  bool exact = false;  ///< the times of bounces closer than `close` are exact
};

/// Cuts the record into stretches: at gaps in the record, where several contacts are hit at one
/// instant, where impacts are closer than `close` (unless they end a chatter or are exact), and
/// where a path cannot be computed. Stretches with fewer than `fewest` equations are dropped. If a
/// contact opens and no other event is within `close`, its gap and gap velocity are zero there.
/// This does not hold for a contact that is closed at `begins`, because the machine may start
/// inside its support.
Stretches cut(std::span<const ContactEvent> events, const RecordSettings& settings,
              std::size_t fewest);

/// Visits the parts of the flight to impact k of a stretch in order: visit(from, to, held,
/// passage). `passage` is the one at `to`, or null if the impact is there.
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

/// Total number of impacts, and of equations.
std::size_t count(const Stretches& stretches);
std::size_t equations(const Stretches& stretches);

/// Impacts number first to first + size - 1 of all. A stretch that loses its first impacts starts
/// at its first remaining one.
Stretches part(const Stretches& stretches, std::size_t first, std::size_t size);

/// Median time between neighbouring impacts, weighted by duration: intervals up to this one make up
/// half of the record. The many short intervals of a chatter then have little weight. 0 if there
/// are none.
double usual_interval(const Stretches& stretches);

}  // namespace sprag
