/// \file
/// \brief Contact events, the only data that a master sends to its observer, and sets of contacts.
///
/// Contacts are counted from 0 in C++, and from 1 in files and messages for people. The contact
/// state chi is that of Baumann & Leine 2014, eq. (5): bit i is set while contact i is closed.
///
/// The sensor's clock, [clock] of a scene, reads t_clock = offset + rate t at the machine's time t.
/// A clock that is 200 ppm fast has the rate 1.0002. Programs convert event times to the machine's
/// time where they enter: from a file or from a message. All functions of the library take the
/// machine's time.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>

namespace sprag {

/// \brief Largest number of contacts. A set of contacts is a 64-bit mask in memory and messages.
inline constexpr int max_contacts = 60;

/// \brief Kind of a contact event.
enum class ContactEventKind : std::int8_t {
  closes = 1,  ///< the contact closes and stays closed: its impact has restitution 0
  opens = 2,   ///< the contact opens
  pulse = 3    ///< an isolated impact with restitution epsilon: closes and opens at one instant
};

/// \brief A contact closes, opens or has a pulse at time t.
struct ContactEvent {
  double t;               ///< simulated time [s], unrounded
  int contact;            ///< from 0
  ContactEventKind kind;  ///< kind of event

  /// \brief Compares all members.
  friend bool operator==(const ContactEvent&, const ContactEvent&) = default;
};

/// \brief Set of contacts, bit i for contact i (from 0): chi, or a set L of locked contacts.
using ContactSet = std::uint64_t;

/// \brief Set of one contact.
/// \param contact from 0.
/// \return the set.
constexpr ContactSet bit(int contact) { return ContactSet{1} << contact; }

/// \brief Whether a set contains a contact.
/// \param set the set.
/// \param contact from 0.
/// \return true if it does.
constexpr bool contains(ContactSet set, int contact) { return ((set >> contact) & 1U) != 0; }

/// \brief Calls a function for each contact of a set, in ascending order.
/// \param set the set.
/// \param visit visit(i) with i from 0.
template <typename Visit>
void for_each(ContactSet set, Visit visit) {
  for (; set != 0; set &= set - 1) visit(std::countr_zero(set));
}

/// \brief Contact state after an event.
/// \param chi contact state before it.
/// \param event the event.
/// \return chi after it; a pulse leaves its contact open.
constexpr ContactSet after(ContactSet chi, const ContactEvent& event) {
  return event.kind == ContactEventKind::closes ? chi | bit(event.contact)
                                                : chi & ~bit(event.contact);
}

/// \brief Interval in which events may be missing, because they were lost or are contradictory.
struct EventGap {
  double from = 0.0;  ///< begin [s]
  double to = 0.0;    ///< end [s]

  /// \brief Compares two intervals.
  friend bool operator==(const EventGap&, const EventGap&) = default;
};

/// \brief Interval of simulated time in which an observer's events may be missing.
struct DegradedInterval {
  double from = 0.0;       ///< begin [s]
  double to = 0.0;         ///< end [s]
  std::int64_t start = 0;  ///< number of the observer's start that it belongs to, from 1
};

/// \brief Why an event was skipped.
enum class Skip {
  backwards,        ///< earlier than the event before it, or not after the horizon
  beyond_horizon,   ///< later than its own message's horizon
  unknown_contact,  ///< of a contact that the machine does not have
  contradicting     ///< a closing or a pulse of a closed contact, or an opening of an open one
};
/// \brief Number of values of Skip.
inline constexpr std::size_t skips = 4;

/// \brief Events that an observer has taken and skipped.
struct EventCounts {
  std::int64_t events = 0;        ///< taken or inserted
  std::int64_t made_up = 0;       ///< inserted so that chi agrees with a message after a gap
  std::int64_t lost_records = 0;  ///< not received, nor repeated in a message
  std::array<std::int64_t, skips> skipped{};  ///< by Skip

  /// \brief Number of events that were skipped for one cause.
  /// \param cause the cause.
  /// \return the number.
  std::int64_t of(Skip cause) const { return skipped[static_cast<std::size_t>(cause)]; }
};

/// \brief Calls a function for the events of each instant. Events of one instant are one impact.
/// \param events in order of time.
/// \param visit visit(events_of_the_instant) with a span.
template <typename Visit>
void for_each_instant(std::span<const ContactEvent> events, Visit visit) {
  while (!events.empty()) {
    std::size_t count = 1;
    while (count < events.size() && events[count].t == events.front().t) ++count;
    visit(events.first(count));
    events = events.subspan(count);
  }
}

/// \brief Offset and rate of the contact clock against the machine's time.
struct ContactClock {
  double offset = 0.0;  ///< reading of the contact clock at the machine's t = 0 [s]
  double rate = 1.0;    ///< seconds of the contact clock per second of the machine, > 0

  /// \brief Whether the contact clock reads the machine's time.
  /// \return true if it does.
  bool is_true() const { return offset == 0.0 && rate == 1.0; }
  /// \brief Compares two clocks.
  friend bool operator==(const ContactClock&, const ContactClock&) = default;
};

/// \brief The machine's time at a reading of the contact clock; the reading itself if it is_true().
/// \param clock the contact clock.
/// \param t_clock reading [s].
/// \return (t_clock - offset) / rate [s].
constexpr double machine_time(const ContactClock& clock, double t_clock) {
  return (t_clock - clock.offset) / clock.rate;
}

/// \brief The reading of the contact clock; the time itself if the clock is_true().
/// \param clock the contact clock.
/// \param t the machine's time [s].
/// \return offset + rate t [s].
constexpr double clock_time(const ContactClock& clock, double t) {
  return clock.offset + clock.rate * t;
}

}  // namespace sprag
