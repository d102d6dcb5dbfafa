#include "sprag/detail/import/import.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "sprag/detail/import/clock_time.h"
#include "sprag/detail/import/contact_edges.h"

namespace sprag {

namespace {

constexpr double never = std::numeric_limits<double>::infinity();

struct Stamp {
  double t;
  std::size_t line;
};

class Importer {
 public:
  Importer(const ColumnFile& columns, const ImportOptions& options)
      : columns_(columns), options_(options) {
    result_.problems = columns.problems;
  }

  void add(const ContactColumns& chosen) {
    ContactEdges edges(chosen.contact,
                       {options_.debounce, options_.pulse_shorter_than, options_.duration});
    if (chosen.impacts) {
      add_impacts(edges, chosen.contact, *chosen.impacts);
    } else {
      add_contacts(edges, chosen.contact, *chosen.on, *chosen.off);
    }
    edges.finish();
    const std::vector<ContactEvent> events = edges.take_events();
    result_.events.insert(result_.events.end(), events.begin(), events.end());
    const EdgeCounts& counts = edges.counts();
    result_.figures.push_back({.contact = chosen.contact,
                               .pulses = counts.pulses,
                               .sustained = counts.sustained,
                               .merged = counts.merged});
    result_.before_start += counts.before_start;
    result_.after_duration += counts.after_duration;
  }

  Import take() {
    std::ranges::stable_sort(result_.events, {}, &ContactEvent::t);
    std::ranges::stable_sort(result_.closings, {}, &Closing::t);
    std::ranges::stable_sort(result_.problems, {}, &RowProblem::line);
    return std::move(result_);
  }

 private:
  /// The times of a column in ascending order.
  std::vector<Stamp> stamps(std::size_t index) {
    const auto mark = columns_.separator == ',' ? DecimalMark::point : DecimalMark::point_or_comma;
    std::vector<Stamp> stamps;
    bool falls = false;
    Decimal last = options_.offset;
    for (const Cell& cell : columns_.columns[index].cells) {
      const auto time = parse_clock_time(cell.text, mark);
      Decimal value = time ? time->value : Decimal{};
      const bool clock = time && time->kind != ClockTime::Kind::number;
      if (time && time->kind == ClockTime::Kind::time_of_day) value = after_midnight(value, last);
      last = value;
      result_.of_clock = result_.of_clock || clock;
      const Decimal unit = clock ? Decimal{1, 0} : options_.unit;
      const double t = time ? difference_in(value, options_.offset, unit) / options_.rate : never;
      if (std::isfinite(t)) {
        if (!stamps.empty() && t < stamps.back().t && !std::exchange(falls, true)) {
          result_.falls.push_back({cell.line, columns_.columns[index].name,
                                   "the time goes back, to " + std::string(cell.text)});
        }
        stamps.push_back({t, cell.line});
      } else {
        refuse(index, cell.line, std::string(cell.text).append(" is not a finite number"));
      }
    }
    std::ranges::stable_sort(stamps, {}, &Stamp::t);
    return stamps;
  }

  void add_impacts(ContactEdges& edges, int contact, std::size_t column) {
    for (const auto& [t, line] : stamps(column)) {
      result_.closings.push_back({t, contact, true});
      if (const std::string what = edges.impact(t); !what.empty()) refuse(column, line, what);
    }
  }

  void add_contacts(ContactEdges& edges, int contact, std::size_t on_column,
                    std::size_t off_column) {
    const std::vector<Stamp> ons = stamps(on_column);
    const std::vector<Stamp> offs = stamps(off_column);
    for (const Stamp& on : ons) result_.closings.push_back({on.t, contact, false});
    auto on = ons.begin();
    auto off = offs.begin();
    while (on != ons.end() || off != offs.end()) {
      const double next_on = on != ons.end() ? on->t : never;
      const double next_off = off != offs.end() ? off->t : never;
      // For a closing and an opening at one instant, the one that is possible comes first.
      if (next_on < next_off || (next_on == next_off && !edges.closed())) {
        if (const std::string what = edges.close(next_on); !what.empty())
          refuse(on_column, on->line, what);
        ++on;
      } else {
        if (const std::string what = edges.open(next_off); !what.empty())
          refuse(off_column, off->line, what);
        ++off;
      }
    }
  }

  void refuse(std::size_t column, std::size_t line, std::string what) {
    result_.problems.push_back({line, columns_.columns[column].name, std::move(what)});
  }

  const ColumnFile& columns_;
  const ImportOptions& options_;
  Import result_;
};

}  // namespace

Import import_events(const ColumnFile& columns, const std::vector<ContactColumns>& chosen,
                     const ImportOptions& options) {
  Importer importer(columns, options);
  for (const ContactColumns& contact : chosen) importer.add(contact);
  return importer.take();
}

}  // namespace sprag
