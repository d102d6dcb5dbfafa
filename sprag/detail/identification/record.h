// Recorded events as input of an identification: stretches of impacts of single contacts. Between
// the impacts all contacts are open, or some are held closed.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/identification.h"

namespace sprag {

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
