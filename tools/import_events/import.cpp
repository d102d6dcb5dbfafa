#include "tools/import_events/import.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "tools/import_events/clock_time.h"

namespace sprag {

namespace {

using enum ContactEventKind;

constexpr double never = std::numeric_limits<double>::infinity();

struct Stamp {
  double t;
  std::size_t line;
};

/// The interval in which a contact is closed.
struct Span {
  double on, off;
};

/// Whether `to` - `from` < `limit` by more than the rounding of the two.
bool shorter(double from, double to, double limit) {
  const double rounding =
      2.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(from), std::abs(to));
  return to - from < limit - rounding;
}

std::string time_text(double t) {
  std::array<char, 32> text;
  const int length = std::snprintf(text.data(), text.size(), "t = %.9g", t);
  return {text.data(), static_cast<std::size_t>(length)};
}

class Importer {
 public:
  Importer(const ColumnFile& columns, const ImportOptions& options)
      : columns_(columns), options_(options) {
    result_.problems = columns.problems;
  }

  void add(const ContactColumns& chosen) {
    figures_ = {.contact = chosen.contact};
    if (chosen.impacts) {
      for (const double t : impacts(*chosen.impacts)) add_pulse(t);
    } else {
      for (const Span& span : contacts(*chosen.on, *chosen.off)) add_contact(span);
    }
    result_.figures.push_back(figures_);
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
    Decimal last = options_.offset;
    for (const Cell& cell : columns_.columns[index].cells) {
      const auto time = parse_clock_time(cell.text, mark);
      Decimal value = time ? time->value : Decimal{};
      const bool clock = time && time->kind != ClockTime::Kind::number;
      if (time && time->kind == ClockTime::Kind::time_of_day) value = after_midnight(value, last);
      last = value;
      result_.of_clock = result_.of_clock || clock;
      const Decimal unit = clock ? Decimal{1, 0} : options_.unit;
      const double t = time ? difference_in(value, options_.offset, unit) : never;
      if (std::isfinite(t)) {
        stamps.push_back({t, cell.line});
      } else {
        refuse(index, cell.line, std::string(cell.text).append(" is not a finite number"));
      }
    }
    std::ranges::stable_sort(stamps, {}, &Stamp::t);
    return stamps;
  }

  std::vector<double> impacts(std::size_t column) {
    std::vector<double> times;
    double last = -never;
    for (const auto& [t, line] : stamps(column)) {
      result_.closings.push_back({t, figures_.contact, true});
      if (shorter(last, t, options_.debounce)) {
        ++figures_.merged;
      } else if (t == last) {
        refuse(column, line, "impact at " + time_text(t) + ", where there is one already");
      } else {
        times.push_back(t);
      }
      last = t;
    }
    return times;
  }

  std::vector<Span> contacts(std::size_t on_column, std::size_t off_column) {
    const std::vector<Stamp> ons = stamps(on_column);
    const std::vector<Stamp> offs = stamps(off_column);
    for (const Stamp& on : ons) result_.closings.push_back({on.t, figures_.contact, false});
    std::vector<Span> spans;
    bool closed = false;
    double last_on = -never;
    auto on = ons.begin();
    auto off = offs.begin();
    while (on != ons.end() || off != offs.end()) {
      const double next_on = on != ons.end() ? on->t : never;
      const double next_off = off != offs.end() ? off->t : never;
      // For a closing and an opening at one instant, the one that is possible comes first.
      if (next_on < next_off || (next_on == next_off && !closed)) {
        if (const std::string what = close(next_on, closed, last_on, spans); !what.empty())
          refuse(on_column, on->line, what);
        ++on;
      } else {
        if (const std::string what = open(next_off, closed, spans); !what.empty())
          refuse(off_column, off->line, what);
        ++off;
      }
    }
    return spans;
  }

  /// Takes a closing, or returns why it is refused.
  std::string close(double t, bool& closed, double& last_on, std::vector<Span>& spans) {
    const bool bounces =
        !spans.empty() && shorter(closed ? last_on : spans.back().off, t, options_.debounce);
    if (bounces) {
      ++figures_.merged;
      spans.back().off = never;
    } else if (closed) {
      return "closes at " + time_text(t) + ", but is closed already since " +
             time_text(spans.back().on);
    } else if (!spans.empty() && spans.back().on == t) {
      return "closes at " + time_text(t) + ", where it has closed already";
    } else {
      spans.push_back({t, never});
    }
    closed = true;
    last_on = t;
    return {};
  }

  /// Takes an opening, or returns why it is refused.
  std::string open(double t, bool& closed, std::vector<Span>& spans) {
    if (!closed) {
      if (spans.empty() || !shorter(spans.back().off, t, options_.debounce))
        return "opens at " + time_text(t) + ", but is open already";
      ++figures_.merged;
    }
    spans.back().off = t;
    closed = false;
    return {};
  }

  void add_pulse(double t) {
    if (add({t, figures_.contact, pulse})) ++figures_.pulses;
  }

  void add_contact(const Span& span) {
    if (span.on == span.off || shorter(span.on, span.off, options_.pulse_shorter_than))
      return add_pulse(span.on);
    if (span.on < 0.0 && span.off <= 0.0) {
      result_.before_start += 2;
      return;
    }
    if (add({std::max(span.on, 0.0), figures_.contact, closes})) ++figures_.sustained;
    if (span.off < never) add({span.off, figures_.contact, opens});
  }

  bool add(const ContactEvent& event) {
    if (event.t < 0.0) {
      ++result_.before_start;
    } else if (event.t > options_.duration) {
      ++result_.after_duration;
    } else {
      result_.events.push_back(event);
      return true;
    }
    return false;
  }

  void refuse(std::size_t column, std::size_t line, std::string what) {
    result_.problems.push_back({line, columns_.columns[column].name, std::move(what)});
  }

  const ColumnFile& columns_;
  const ImportOptions& options_;
  ContactFigures figures_;
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
