#include "observer/notices.h"

#include <ostream>

namespace sprag {
namespace {

constexpr std::int64_t period = 1'000'000'000;  // ns

void skipped(double t, double contact, const char* why, std::ostream& out) {
  out << "event of contact " << contact + 1.0 << " at t = " << t << " skipped: " << why
      << "; the estimate may be wrong from there on";
}

void describe(Notice notice, double first, double second, std::ostream& out) {
  switch (notice) {
    case Notice::bad_input:
      out << "message on SPRAG_INPUT refused: it is not of type sprag.input_t, or a count, a time "
             "or a value is out of range";
      return;
    case Notice::unauthenticated:
      out << "message refused: not signed with this key; give the machine the same --key";
      return;
    case Notice::malformed:
      out << "packet refused: not one of LCM's; somebody else uses this port";
      return;
    case Notice::fragment:
      out << "packet refused: part of a larger message than any of Sprag's";
      return;
    case Notice::other_host:
      out << "message refused: from another host; --url with ttl=1 accepts these";
      return;
    case Notice::wrong_type:
      out << "message refused: not of type sprag.contacts_t; its sender was built from another "
             "definition";
      return;
    case Notice::wrong_size:
      out << "message refused: not of the size of sprag.contacts_t; a signed one needs --key";
      return;
    case Notice::bad_count:
      out << "message refused: a count of contacts, records or messages cannot be";
      return;
    case Notice::bad_contact:
      out << "message refused: a record's contact is not in 1 to `contacts`";
      return;
    case Notice::bad_kind:
      out << "message refused: a record's kind is not 1, 2 or 3";
      return;
    case Notice::bad_closed:
      out << "message refused: `closed` has a contact that the machine does not have";
      return;
    case Notice::bad_time:
      out << "message refused: a time is negative or not finite, or records are not in order";
      return;
    case Notice::bad_speed:
      out << "message refused: its speed is not a number > 0";
      return;
    case Notice::other_machine:
      out << "message refused: its machine has " << first << " contacts, the scene " << second;
      return;
    case Notice::crowded:
      out << "messages of others came faster than they can be looked at; they were left out";
      return;
    case Notice::stale:
      out << "message refused: with --key a session begins within 10 s by both hosts' clocks, and "
             "after the one before; this message is "
          << first << " s old";
      return;
    case Notice::odd_time:
      out << "message refused: its horizon t = " << first << " does not go on from t = " << second;
      return;
    case Notice::odd_speed:
      out << "message refused: its speed " << first << " is another than before, or too high";
      return;
    case Notice::odd_number:
      out << "message refused: its number " << first
          << " does not go on from those before; `sequence` must rise by one with every message";
      return;
    case Notice::odd_records:
      out << "message refused: its records_total " << first << " does not go on from those before";
      return;
    case Notice::backwards:
      return skipped(first, second, "not after the event before and the horizon declared", out);
    case Notice::beyond_horizon:
      return skipped(first, second, "later than its own message's horizon", out);
    case Notice::unknown_contact:
      return skipped(first, second, "the scene has no such contact", out);
    case Notice::contradicting:
      return skipped(first, second,
                     "it closes while closed or opens while open, so that one before is missing or "
                     "this one is spurious",
                     out);
    case Notice::gap:
      out << "events may be missing between t = " << first << " and " << second
          << ": more records were lost than messages repeat";
      return;
    case Notice::resumed:
      out << "the machine's messages have jumped from t = " << first << " to t = " << second
          << ": a clock was turned, a host stood still, or an odd message came before; they are "
             "followed";
      return;
  }
}

}  // namespace

void Notices::print(Notice notice, Cause& cause, std::ostream& out) {
  const std::int64_t raised = cause.raised.load(std::memory_order_acquire);
  const std::int64_t more = raised - cause.reported.load(std::memory_order_relaxed) - 1;
  if (more < 0) return;
  const auto digits = out.precision(12);
  describe(notice, cause.first, cause.second, out);
  if (more > 0) out << " (and " << more << " more)";
  out << '\n';
  out.precision(digits);
  // Cases raised meanwhile count for this line, so that the next line has values of its own.
  cause.reported.store(cause.raised.load(std::memory_order_acquire), std::memory_order_release);
}

void Notices::print(std::int64_t now, std::ostream& out) {
  for (std::size_t i = 0; i < notice_kinds; ++i) {
    Cause& cause = causes_[i];
    if (cause.raised.load(std::memory_order_relaxed) ==
        cause.reported.load(std::memory_order_relaxed))
      continue;
    if (now < cause.next_line) continue;
    cause.next_line = now + period;
    print(static_cast<Notice>(i), cause, out);
  }
}

void Notices::print_rest(std::ostream& out) {
  for (std::size_t i = 0; i < notice_kinds; ++i) print(static_cast<Notice>(i), causes_[i], out);
}

void raise_skipped(const EventHistory& history, const EventCounts& before,
                   Notices& notices) noexcept {
  constexpr std::array<Notice, skips> causes{Notice::backwards, Notice::beyond_horizon,
                                             Notice::unknown_contact, Notice::contradicting};
  const EventCounts& counts = history.counts();
  for (std::size_t i = 0; i < skips; ++i) {
    if (counts.skipped[i] == before.skipped[i]) continue;
    const ContactEvent& event = history.last_skipped(static_cast<Skip>(i));
    notices.raise(causes[i], counts.skipped[i] - before.skipped[i], event.t, event.contact);
  }
  if (counts.lost_records == before.lost_records || history.degraded().empty()) return;
  const DegradedInterval& gap = history.degraded().back();
  notices.raise(Notice::gap, 1, gap.from, gap.to);
}

void raise_odd(Oddity oddity, const ContactMessage& message, double horizon,
               Notices& notices) noexcept {
  switch (oddity) {
    case Oddity::none:
      return;
    case Oddity::time:
      return notices.raise(Notice::odd_time, 1, message.horizon, horizon);
    case Oddity::speed:
      return notices.raise(Notice::odd_speed, 1, message.speed);
    case Oddity::number:
      return notices.raise(Notice::odd_number, 1, static_cast<double>(message.sequence));
    case Oddity::records:
      return notices.raise(Notice::odd_records, 1, static_cast<double>(message.records_total));
  }
}

}  // namespace sprag
