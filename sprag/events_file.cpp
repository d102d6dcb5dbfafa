#include "sprag/events_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/events_writer.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

namespace {

constexpr std::string_view events_header = "t,contact,closed";
constexpr std::string_view noted_header = "t,contact,closed,note";
constexpr std::string_view spurious_note = "spurious";

struct Row {
  double t;
  std::int64_t contact;  // from 1
  std::int64_t closed;
};

std::optional<Row> parse_row(std::string_view line, bool noted,
                             std::vector<std::string_view>& fields) {
  split_fields(line, fields);
  if (fields.size() != (noted ? 4U : 3U)) return std::nullopt;
  const auto t = parse_double(fields[0]);
  const auto contact = parse_integer(fields[1]);
  const auto closed = parse_integer(fields[2]);
  if (!t || *t < 0.0 || !contact || !closed) return std::nullopt;
  return Row{*t, *contact, *closed};
}

/// Turns rows into events. add() returns why a row contradicts the rows before it, or an empty
/// text. After a contradiction missing_from() is the time since which an event is missing.
class EventList {
 public:
  explicit EventList(std::vector<ContactEvent>& events) : events_(events) {}

  std::string_view add(const Row& row) {
    missing_from_ = row.t;
    if (row.t < last_t_) return "time goes backwards";
    const int contact = static_cast<int>(row.contact) - 1;
    const bool closes = row.closed == 1;
    if (closes == contains(chi_, contact)) {
      missing_from_ = last_time_of_[static_cast<std::size_t>(contact)];
      return closes ? "contact closes, but is closed already"
                    : "contact opens, but is open already";
    }
    last_t_ = last_time_of_[static_cast<std::size_t>(contact)] = row.t;
    chi_ ^= bit(contact);
    // Other contacts may have rows between the two of a pulse.
    const std::size_t last = last_of_[static_cast<std::size_t>(contact)];
    if (!closes && last < events_.size() && events_[last].t == row.t &&
        events_[last].kind == ContactEventKind::closes) {
      events_[last].kind = ContactEventKind::pulse;
      return {};
    }
    last_of_[static_cast<std::size_t>(contact)] = events_.size();
    events_.push_back(
        {row.t, contact, closes ? ContactEventKind::closes : ContactEventKind::opens});
    return {};
  }

  double last_t() const { return last_t_; }
  double missing_from() const { return missing_from_; }

 private:
  std::vector<ContactEvent>& events_;
  double last_t_ = 0.0;
  double missing_from_ = 0.0;
  std::array<double, max_contacts> last_time_of_{};
  ContactSet chi_ = 0;
  // Index of each contact's last event. A contact without events is open and cannot open, so that
  // its initial 0 is never used.
  std::array<std::size_t, max_contacts> last_of_{};
};

// Throws for values that no row of this machine's events can have.
void check_row(const Row& row, std::string_view line, const std::vector<std::string_view>& fields,
               int contacts, const std::string& file, std::size_t number) {
  const auto fail = [&](std::size_t field, const std::string& what) {
    const std::string_view text = fields[field];
    const std::size_t blanks = std::min(text.find_first_not_of(" \t"), text.size());
    const auto column = static_cast<std::size_t>(text.data() - line.data()) + blanks + 1;
    throw InputError(file + ":" + std::to_string(number) + ":" + std::to_string(column) + ": " +
                     what);
  };
  if (row.contact < 1 || row.contact > contacts) {
    fail(1, "contact is " + std::to_string(row.contact) + "; must be " +
                (contacts == 1 ? std::string("1, the only contact")
                               : "in 1.." + std::to_string(contacts) + ", the contacts") +
                " of the scene, counted from 1");
  }
  if (row.closed != 0 && row.closed != 1) {
    fail(2, "closed is " + std::to_string(row.closed) +
                "; must be 1 (the contact closes) or 0 (it opens)");
  }
}

/// Looks for implausible time stamps.
class Silences {
 public:
  /// Adds a row whose time is not before that of the last row.
  void add(double t, std::size_t line, std::optional<ImplausibleTime>& found) {
    const double most = count_ < few ? strict : lenient;
    if (!found && last_ > 0.0 && t - last_ > most * last_) {
      found = ImplausibleTime{
          t,
          {line, text("t is ", t) + text(", and the event before it is at t = ", last_) +
                     ": a wrong time stamp?"}};
    }
    if (count_ == 0) {
      first_ = t;
      first_line_ = line;
    }
    last_ = t;
    ++count_;
  }

  void end(std::optional<ImplausibleTime>& found) const {
    if (found || count_ < few || first_ == last_) return;
    if (!(first_ > strict * (last_ - first_))) return;
    found = ImplausibleTime{first_,
                            {first_line_, text("the first event is at t = ", first_) +
                                              text(", and all of them last ", last_ - first_) +
                                              ": the times of another clock?"}};
  }

 private:
  static constexpr int few = 10;  // rows
  static constexpr double strict = 1e4;
  static constexpr double lenient = 200.0;

  static std::string text(std::string what, double number) {
    std::array<char, 32> digits;
    std::snprintf(digits.data(), digits.size(), "%.9g", number);
    return what += digits.data();
  }

  double first_ = 0.0, last_ = 0.0;
  std::size_t first_line_ = 0;
  int count_ = 0;
};

}  // namespace

std::string_view name_of(EventNote note) {
  switch (note) {
    case EventNote::lost:
      return "lost";
    case EventNote::spurious:
      return spurious_note;
    case EventNote::suspect:
      return "suspect";
    default:
      return "";
  }
}

EventsWriter::EventsWriter(OutputFile file) : CsvWriter(std::move(file), events_header, 64) {}

void EventsWriter::write(const ContactEvent& event) noexcept {
  if (event.kind != ContactEventKind::opens) write_row(event.t, event.contact, "1");
  if (event.kind != ContactEventKind::closes) write_row(event.t, event.contact, "0");
}

void EventsWriter::write_row(double t, int contact, std::string_view closed) noexcept {
  add(t);
  add(std::int64_t{contact} + 1);
  add(closed);
  end_row();
}

NotedEventsWriter::NotedEventsWriter(const std::filesystem::path& file)
    : CsvWriter(OutputFile(file), noted_header, 64) {}

void NotedEventsWriter::write(const ContactEvent& event, EventNote note) noexcept {
  for (const bool closed : {true, false}) {
    if (event.kind == (closed ? ContactEventKind::opens : ContactEventKind::closes)) continue;
    add(event.t);
    add(std::int64_t{event.contact} + 1);
    add(closed ? "1" : "0");
    add(name_of(note));
    end_row();
  }
}

std::size_t to_machine_time(const ContactClock& clock, EventsFile& file) {
  if (clock.is_true()) return 0;
  ContactSet closed = 0;  // at t = 0
  std::size_t before = 0;
  for (ContactEvent& event : file.events) {
    event.t = machine_time(clock, event.t);
    if (!(event.t < 0.0)) continue;
    closed = after(closed, event);
    ++before;
  }
  file.events.erase(file.events.begin(), file.events.begin() + static_cast<std::ptrdiff_t>(before));
  std::vector<ContactEvent> at_start;
  for (int i = 0; i < max_contacts; ++i) {
    if (contains(closed, i)) at_start.push_back({0.0, i, ContactEventKind::closes});
  }
  file.events.insert(file.events.begin(), at_start.begin(), at_start.end());
  for (EventGap& gap : file.gaps) {
    gap = {std::max(machine_time(clock, gap.from), 0.0), machine_time(clock, gap.to)};
  }
  std::erase_if(file.gaps, [](const EventGap& gap) { return gap.to <= 0.0; });
  return before - at_start.size();
}

EventsFile read_events(const std::filesystem::path& file, int contacts) {
  return read_events(InputFile(file), contacts);
}

EventsFile read_events(InputFile file, int contacts) {
  const std::string name = file.path().string();
  LineReader reader(std::move(file));
  EventsFile result;
  std::string_view line;
  LineReader::Result got = reader.next(line);
  const bool noted = got == LineReader::Result::line && line == noted_header;
  if (got != LineReader::Result::line || (line != events_header && !noted)) {
    result.damage = {1, std::string("header must be ").append(events_header)};
    result.gaps = {{0.0, infinity}};
    return result;
  }
  EventList list(result.events);
  Silences silences;
  std::vector<std::string_view> fields;
  while ((got = reader.next(line)) == LineReader::Result::line) {
    if (line.empty()) continue;
    const auto row = parse_row(line, noted, fields);
    if (!row) {
      std::string expected("garbled line (expected ");
      expected.append(events_header).append(" with t finite and >= 0)");
      result.damage = {reader.number(), std::move(expected)};
      add({list.last_t(), infinity}, result.gaps);
      silences.end(result.implausible);
      return result;
    }
    if (noted && fields[3] == spurious_note) continue;
    check_row(*row, line, fields, contacts, name, reader.number());
    if (const auto what = list.add(*row); !what.empty()) {
      result.skipped.push_back({reader.number(), std::string(what)});
      add({list.missing_from(), row->t}, result.gaps);
    } else {
      silences.add(row->t, reader.number(), result.implausible);
    }
  }
  silences.end(result.implausible);
  if (got != LineReader::Result::end) {
    result.damage = {reader.number(), describe(got)};
    add({list.last_t(), infinity}, result.gaps);
  }
  return result;
}

}  // namespace sprag
