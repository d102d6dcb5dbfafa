// What one contact did, and when: the only thing that travels from master to observer.
// A pulse closes and opens at the same instant (an isolated impact, restitution epsilon);
// a contact that closes to stay takes restitution 0 (Baumann & Leine 2014, eq. (5): chi).
#pragma once

#include <bit>
#include <cstdint>
#include <span>

namespace sprag {

/// Contacts are bits of a 64-bit mask in memory and in messages.
inline constexpr int max_contacts = 60;

enum class ContactEventKind : std::int8_t { closes = 1, opens = 2, pulse = 3 };

struct ContactEvent {
  double t;     ///< simulated time [s], unrounded
  int contact;  ///< index from 0 (files and messages count from 1)
  ContactEventKind kind;

  friend bool operator==(const ContactEvent&, const ContactEvent&) = default;
};

/// Set of contacts, bit i for contact i (from 0): chi, or a locked set L.
using ContactSet = std::uint64_t;

constexpr ContactSet bit(int contact) { return ContactSet{1} << contact; }
constexpr bool contains(ContactSet set, int contact) { return ((set >> contact) & 1U) != 0; }

/// visit(i) for each contact of the set, in ascending order.
template <typename Visit>
void for_each(ContactSet set, Visit visit) {
  for (; set != 0; set &= set - 1) visit(std::countr_zero(set));
}

/// chi after the event, given chi before it.
constexpr ContactSet after(ContactSet chi, const ContactEvent& event) {
  return event.kind == ContactEventKind::closes ? chi | bit(event.contact)
                                                : chi & ~bit(event.contact);
}

/// visit(events) for the events of each instant, which are one impact; `events` in order of time.
template <typename Visit>
void for_each_instant(std::span<const ContactEvent> events, Visit visit) {
  while (!events.empty()) {
    std::size_t count = 1;
    while (count < events.size() && events[count].t == events.front().t) ++count;
    visit(events.first(count));
    events = events.subspan(count);
  }
}

}  // namespace sprag
