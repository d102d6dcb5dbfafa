// Turns the edges of one contact, in order of time, into its contact events. import_events uses it
// for a whole recording, listen for edges as they arrive. It knows neither a clock nor a file.
//
// Rules, with times in seconds:
// * Debouncing of contacts: if the time from the last opening of a contact to its next closing is
//   shorter than `debounce`, both are one contact, which closes at the first closing and opens at
//   the last opening. A closing while closed, or an opening while open, within that time after the
//   previous one is also a bounce.
// * Debouncing of impacts: if the time from the last impact to the next is shorter, they are one
//   impact at the time of the first. Bounces chain.
// * Pulses: if the time from a contact's closing to its opening, after debouncing, is shorter than
//   `pulse_shorter_than`, or zero, it is a pulse at the closing. Other contacts are sustained.
// A time that equals the limit within the rounding of its ends is not shorter.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag {

struct EdgeRules {
  double debounce = 0.0;            ///< [s]; 0: none
  double pulse_shorter_than = 0.0;  ///< [s]; 0: only contacts of zero duration
  double duration = std::numeric_limits<double>::infinity();  ///< later events are left out [s]
};

struct EdgeCounts {
  std::int64_t pulses = 0;          ///< events that were made
  std::int64_t sustained = 0;       ///< closings that were made
  std::int64_t merged = 0;          ///< bounces merged with the contact or impact before
  std::int64_t before_start = 0;    ///< events omitted because they lie before t = 0
  std::int64_t after_duration = 0;  ///< events omitted because they lie after the duration

  EdgeCounts& operator+=(const EdgeCounts& other);
};

class ContactEdges {
 public:
  /// `contact` from 0.
  ContactEdges(int contact, const EdgeRules& rules) : contact_(contact), rules_(rules) {}

  /// Takes the next edge, not before the last one. Returns why it is refused; empty: it is taken.
  std::string close(double t);
  std::string open(double t);
  std::string impact(double t);

  /// Every later edge comes after `t`. Makes the events that are then known.
  void advance(double t);

  /// No edge follows: a contact that is closed stays closed.
  void finish() { advance(std::numeric_limits<double>::infinity()); }

  /// Every event up to this time has been made: the time of the last advance(), or just before the
  /// closing or opening of a contact that is still undecided. Never falls.
  double watermark() const;

  /// The events that were made since the last call, times ascending and >= 0. A contact that closes
  /// before t = 0 and opens later closes at t = 0.
  std::vector<ContactEvent> take_events();

  bool closed() const { return closed_; }  ///< after the last edge
  const EdgeCounts& counts() const { return counts_; }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity();

  void settle();
  void settle_closing();
  bool add(double t, ContactEventKind kind);

  int contact_;
  EdgeRules rules_;
  EdgeCounts counts_;
  std::vector<ContactEvent> events_;
  double now_ = -never;

  // The last contact: from `on_` to `off_`, which is `never` while it is closed.
  double on_ = -never, off_ = -never;
  double last_on_ = -never;  // its last closing, a bounce included
  bool any_ = false;         // there is one
  bool closed_ = false;
  bool begun_ = false;  // its closing event has been made or omitted
  bool ended_ = true;   // nothing can change it any more
  double last_impact_ = -never;
};

}  // namespace sprag
