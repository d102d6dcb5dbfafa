// Events of a record as the data of a fit, in stretches that a path can follow.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/filter/flight.h"
#include "sprag/identification.h"

namespace sprag {

struct FitEvent {
  double t = 0.0;   ///< recorded time; a guess if not `timed` [s]
  int contact = 0;  ///< from 0
  ContactEventKind kind = ContactEventKind::pulse;
  bool timed = true;      ///< false: inserted, because the record lost it
  std::size_t index = 0;  ///< number in the record, if `timed`
  /// false: the path has the event at about its recorded time, but the fit does not use its gap. It
  /// is too close to another one, or the contact opens after a chatter that is merged to one
  /// closing, so that its force is not known.
  bool informs = true;

  bool impact() const { return kind != ContactEventKind::opens; }
};

/// Consecutive events from an unknown state at `start`. Contacts in `held` are closed at `start`.
struct FitStretch {
  double start = 0.0;
  ContactSet held = 0;
  std::vector<FitEvent> events;

  std::size_t size() const { return events.size(); }
  /// Contacts closed before event k.
  ContactSet held_before(std::size_t k) const;
  /// Events first to last - 1. The part starts at its first event, except at that of the stretch.
  FitStretch part(std::size_t first, std::size_t last) const;
  FitStretch without(std::size_t k) const;
  FitStretch with(std::size_t k, const FitEvent& event) const;
};

/// A state on a path, and the contacts that are closed.
struct PathPoint {
  Eigen::VectorXd x;
  double t = 0.0;
  ContactSet held = 0;
};

/// Moves along the path to just after an event, which the path has at `time`.
void pass(Flight& flight, const FitEvent& event, double time, PathPoint& at);

struct FitRecord {
  std::vector<FitStretch> stretches;  ///< the longest one first
  std::size_t events = 0;             ///< of the record
  std::size_t merged = 0;             ///< events that a path cannot tell from their neighbours
  double interval = 0.0;              ///< usual_interval() [s]
  double begins = 0.0;                ///< begin of the recording [s]
  double end = 0.0;                   ///< largest absolute time [s]
};

/// Cuts a record where events are missing, where a path cannot be computed, and at events closer
/// than `close` [s]. Events that close at the end of a chatter become one closing.
FitRecord fit_record(std::span<const ContactEvent> events, const IdentificationSettings& settings,
                     double close, const Flight& flight);

/// The time between neighbouring events such that half of the record is in longer ones: that of
/// flights, also where most events are of chatters.
double usual_interval(std::span<const ContactEvent> events);

}  // namespace sprag
