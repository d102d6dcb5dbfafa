#include "observer/notices.h"

#include <array>
#include <ostream>
#include <string_view>

namespace sprag {
namespace {

constexpr std::int64_t period = 1'000'000'000;  // ns

// The texts by Notice; {1} and {2} stand for the two values.
constexpr std::array<std::string_view, notice_kinds> texts{
    "message refused: not signed with this key; give the machine the same --key",
    "packet refused: not one of LCM's; somebody else uses this port",
    "packet refused: part of a larger message than any of Sprag's",
    "message refused: from another host; --url with ttl=1 accepts these",
    "message refused: not of type sprag.contacts_t; its sender was built from another definition",
    "message refused: not of the size of sprag.contacts_t; a signed one needs --key",
    "message refused: a count of contacts, records or messages cannot be",
    "message refused: a record's contact is not in 1 to `contacts`",
    "message refused: a record's kind is not 1, 2 or 3",
    "message refused: `closed` has a contact that the machine does not have",
    "message refused: a time is negative or not finite, or records are not in order",
    "message refused: its speed is not a number > 0",
    "message refused: its machine has {1} contacts, the scene {2}",
    "messages of others came faster than they can be looked at; they were left out",
    "message refused: with --key a session begins within 10 s by both hosts' clocks, and after the "
    "one before; this message is {1} s old",
    "message refused: its horizon t = {1} does not go on from t = {2}",
    "message refused: its speed {1} is another than before, or too high",
    "message refused: its number {1} does not go on from those before; `sequence` must rise by one "
    "with every message",
    "message refused: its records_total {1} does not go on from those before",
    "event of contact {2} at t = {1} skipped: not after the event before and the horizon declared; "
    "the estimate may be wrong from there on",
    "event of contact {2} at t = {1} skipped: later than its own message's horizon; the estimate "
    "may be wrong from there on",
    "event of contact {2} at t = {1} skipped: the scene has no such contact; the estimate may be "
    "wrong from there on",
    "event of contact {2} at t = {1} skipped: it closes while closed or opens while open, so that "
    "one before is missing or this one is spurious; the estimate may be wrong from there on",
    "events may be missing between t = {1} and {2}: more records were lost than messages repeat",
    "the machine's messages have jumped from t = {1} to t = {2}: a clock was turned, a host stood "
    "still, or an odd message came before; they are followed",
    "message on SPRAG_INPUT refused: it is not of type sprag.input_t, or a count, a time or a "
    "value is out of range"};

void describe(Notice notice, double first, double second, std::ostream& out) {
  std::string_view text = texts[static_cast<std::size_t>(notice)];
  for (auto value = text.find('{'); value != text.npos; value = text.find('{')) {
    out << text.substr(0, value) << (text[value + 1] == '1' ? first : second);
    text.remove_prefix(value + 3);
  }
  out << text;
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
    notices.raise(causes[i], counts.skipped[i] - before.skipped[i], event.t, event.contact + 1);
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
