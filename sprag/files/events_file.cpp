#include "sprag/files/events_file.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "sprag/mechanics/scalars.h"

namespace sprag {

namespace {

constexpr std::string_view events_header = "t,contact,closed";

struct Row {
  double t;
  std::int64_t contact;  // from 1
  std::int64_t closed;
};

std::optional<Row> parse_row(std::string_view line, std::vector<std::string_view>& fields) {
  split_fields(line, fields);
  if (fields.size() != 3) return std::nullopt;
  const auto t = parse_double(fields[0]);
  const auto contact = parse_integer(fields[1]);
  const auto closed = parse_integer(fields[2]);
  if (!t || *t < 0.0 || !contact || !closed) return std::nullopt;
  return Row{*t, *contact, *closed};
}

/// Turns rows into events; add() returns what contradicts the rows before, or nothing. After that
/// missing_from() is the time from which on an event is missing because of it.
class EventList {
 public:
  EventList(std::vector<ContactEvent>& events, int contacts)
      : events_(events), contacts_(contacts) {}

  std::string_view add(const Row& row) {
    missing_from_ = row.t;
    if (row.contact < 1 || row.contact > contacts_) return "unknown contact";
    if (row.closed != 0 && row.closed != 1) return "closed must be 1 or 0";
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
  int contacts_;
  double last_t_ = 0.0;
  double missing_from_ = 0.0;
  std::array<double, max_contacts> last_time_of_{};
  ContactSet chi_ = 0;
  // Index of each contact's last event. Before its first one a contact is open, so it cannot open
  // and the zero is never looked at.
  std::array<std::size_t, max_contacts> last_of_{};
};

}  // namespace

EventsWriter::EventsWriter(OutputFile file) : CsvWriter(std::move(file), events_header, 64) {}

void EventsWriter::write(const ContactEvent& event) noexcept {
  if (event.kind != ContactEventKind::opens) write_row(event.t, event.contact, '1');
  if (event.kind != ContactEventKind::closes) write_row(event.t, event.contact, '0');
}

void EventsWriter::write_row(double t, int contact, char closed) noexcept {
  row_.clear();
  append_number(row_, t);
  row_ += ',';
  append_number(row_, std::int64_t{contact} + 1);
  row_ += ',';
  row_ += closed;
  row_ += '\n';
  file_.write(row_);
}

EventsFile read_events(const std::filesystem::path& file, int contacts) {
  return read_events(InputFile(file), contacts);
}

EventsFile read_events(InputFile file, int contacts) {
  LineReader reader(std::move(file));
  EventsFile result;
  std::string_view line;
  LineReader::Result got = reader.next(line);
  if (got != LineReader::Result::line || line != events_header) {
    result.damage = {1, std::string("header must be ").append(events_header)};
    result.gaps = {{0.0, infinity}};
    return result;
  }
  EventList list(result.events, contacts);
  std::vector<std::string_view> fields;
  while ((got = reader.next(line)) == LineReader::Result::line) {
    if (line.empty()) continue;
    const auto row = parse_row(line, fields);
    if (!row) {
      std::string expected("garbled line (expected ");
      expected.append(events_header).append(" with t finite and >= 0)");
      result.damage = {reader.number(), std::move(expected)};
      add({list.last_t(), infinity}, result.gaps);
      return result;
    }
    if (const auto what = list.add(*row); !what.empty()) {
      result.skipped.push_back({reader.number(), std::string(what)});
      add({list.missing_from(), row->t}, result.gaps);
    }
  }
  if (got != LineReader::Result::end) {
    result.damage = {reader.number(), describe(got)};
    add({list.last_t(), infinity}, result.gaps);
  }
  return result;
}

}  // namespace sprag
