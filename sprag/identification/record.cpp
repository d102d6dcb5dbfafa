#include "sprag/identification/record.h"

#include <algorithm>

namespace sprag {
namespace {

// Pieces of a stretch that is longer than what one solution should span.
void append_in_pieces(const Stretch& stretch, std::size_t longest, std::size_t fewest,
                      Stretches& stretches) {
  if (stretch.equations() < fewest) return;
  const std::size_t pieces = (stretch.size() + longest - 1) / longest;
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::size_t first = i * stretch.size() / pieces;
    const std::size_t last = (i + 1) * stretch.size() / pieces;
    Stretch piece{i == 0 ? stretch.start : stretch.impacts[first].t, {}};
    if (i == 0) piece.released = stretch.released;
    piece.impacts.assign(stretch.impacts.begin() + static_cast<std::ptrdiff_t>(first),
                         stretch.impacts.begin() + static_cast<std::ptrdiff_t>(last));
    stretches.push_back(std::move(piece));
  }
}

}  // namespace

Stretches cut(std::span<const ContactEvent> events, const RecordSettings& settings,
              std::size_t fewest) {
  Stretches stretches;
  Stretch now{settings.begins, {}};
  ContactSet chi = settings.closed;
  ContactSet inside = chi;  // perhaps: closed since the beginning
  // Whether the state at now.start goes on from there in free flight.
  bool flies = chi == 0;
  const auto end = [&] {
    append_in_pieces(now, settings.longest, fewest, stretches);
    now.impacts.clear();
    flies = false;
  };
  std::size_t i = 0;
  while (i < events.size()) {
    std::size_t next = i + 1;
    while (next < events.size() && events[next].t == events[i].t) ++next;
    const ContactEvent& event = events[i];
    const bool single = next == i + 1 && event.kind == ContactEventKind::pulse && chi == 0;
    // What comes near to another event may be its impact's.
    const bool alone = next == i + 1 && (i == 0 || event.t - events[i - 1].t >= settings.close) &&
                       (next == events.size() || events[next].t - event.t >= settings.close);
    const bool releases = alone && event.kind == ContactEventKind::opens &&
                          chi == bit(event.contact) && (inside & chi) == 0;
    for (std::size_t j = i; j < next; ++j) chi = after(chi, events[j]);
    inside = event.t > settings.begins ? inside & chi : chi;
    const bool near_before =
        !now.impacts.empty() && event.t - now.impacts.back().t < settings.close;
    if (single && !near_before) {
      if (!flies) now = {event.t, {}};
      flies = true;
      now.impacts.push_back({event.t, event.contact, true, i});
    } else {
      // A contact that closes to stay does so at an impact like any other, but nothing follows.
      const bool closes = next == i + 1 && event.kind == ContactEventKind::closes && flies &&
                          !now.impacts.empty() && !near_before && std::has_single_bit(chi);
      if (closes) now.impacts.push_back({event.t, event.contact, true, i});
      end();
      if (single) {
        now = {event.t, {}};
        now.impacts.push_back({event.t, event.contact, true, i});
        flies = true;
      } else if (chi == 0) {
        now = {event.t, {}};
        if (releases) now.released = event.contact;
        flies = true;
      }
    }
    i = next;
  }
  end();
  return stretches;
}

std::size_t count(const Stretches& stretches) {
  std::size_t impacts = 0;
  for (const Stretch& stretch : stretches) impacts += stretch.size();
  return impacts;
}

Stretches part(const Stretches& stretches, std::size_t first, std::size_t size) {
  Stretches parts;
  std::size_t at = 0;
  for (const Stretch& stretch : stretches) {
    const std::size_t from = std::max(first, at);
    const std::size_t to = std::min(first + size, at + stretch.size());
    if (from < to) {
      const auto begin = stretch.impacts.begin();
      Stretch piece{from == at ? stretch.start : stretch.impacts[from - at].t, {}};
      if (from == at) piece.released = stretch.released;
      piece.impacts.assign(begin + static_cast<std::ptrdiff_t>(from - at),
                           begin + static_cast<std::ptrdiff_t>(to - at));
      parts.push_back(std::move(piece));
    }
    at += stretch.size();
  }
  return parts;
}

std::size_t equations(const Stretches& stretches) {
  std::size_t equations = 0;
  for (const Stretch& stretch : stretches) equations += stretch.equations();
  return equations;
}

double usual_interval(const Stretches& stretches) {
  std::vector<double> intervals;
  double total = 0.0;
  for (const Stretch& stretch : stretches) {
    for (std::size_t i = 1; i < stretch.size(); ++i) {
      intervals.push_back(stretch.impacts[i].t - stretch.impacts[i - 1].t);
      total += intervals.back();
    }
  }
  std::sort(intervals.begin(), intervals.end());
  double passed = 0.0;
  for (const double interval : intervals) {
    passed += interval;
    if (passed >= 0.5 * total) return interval;
  }
  return 0.0;
}

}  // namespace sprag
