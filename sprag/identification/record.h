// Recorded events as identification takes them: stretches of single impacts, each of a machine that
// flies freely between them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "sprag/mechanics/contact_event.h"

namespace sprag {

struct Impact {
  double t = 0.0;
  int contact = 0;        ///< from 0
  bool timed = true;      ///< false: it was missed, and t is a guess
  std::size_t event = 0;  ///< its number among the record's events
};

/// Impacts one after the other from a state of its own at `start`, which is not after the first.
struct Stretch {
  double start = 0.0;
  std::vector<Impact> impacts;
  /// The contact that was closed before `start` and opens there, so that its gap and the gap's
  /// velocity are zero; -1: none did.
  int released = -1;

  std::size_t size() const { return impacts.size(); }
  /// Equations that a release is for the start.
  std::size_t of_release() const { return released >= 0 ? 2 : 0; }
  /// Equations in all.
  std::size_t equations() const { return size() + of_release(); }
};

using Stretches = std::vector<Stretch>;

struct RecordSettings {
  double begins = 0.0;        ///< all events since then are known
  ContactSet closed = 0;      ///< there
  double close = 0.0;         ///< impacts that are nearer to each other are not told apart
  std::size_t longest = 150;  ///< a longer stretch is cut
};

/// Cuts where a contact stays closed, where several are hit at one instant, and where impacts are
/// closer than `close`; stretches with fewer equations than `fewest` are left out. A contact that
/// closed to stay and opens, no other being closed, and no event within `close`, is a release; not
/// one that is closed at `begins`, where a machine may be inside.
Stretches cut(std::span<const ContactEvent> events, const RecordSettings& settings,
              std::size_t fewest);

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
