#include "sprag/detail/identification/events.h"

#include <algorithm>
#include <cmath>

namespace sprag {
namespace {

// Gaps of events as close as this, in distances that cannot be distinguished, are not normally
// distributed: they do not inform.
constexpr double uncertain_within = 3.0;

ContactSet held_after(ContactSet held, const FitEvent& event) {
  return after(held, {event.t, event.contact, event.kind});
}

bool in_gap(double from, double to, std::span<const EventGap> gaps) {
  return std::any_of(gaps.begin(), gaps.end(), [&](const EventGap& gap) {
    return gap.to > gap.from && gap.from < to && gap.to > from;
  });
}

// Cuts a record into stretches, event by event.
class Cutter {
 public:
  Cutter(const Flight& flight, ContactSet closed, std::vector<FitStretch>& out)
      : flight_(&flight), out_(&out), held_(closed) {
    stretch_.held = closed;
  }

  ContactSet held() const { return held_; }
  bool empty() const { return stretch_.events.empty(); }

  void cut() {
    if (!empty()) out_->push_back(std::move(stretch_));
    stretch_ = FitStretch{0.0, held_, {}};
  }

  // Events that the path cannot follow are only applied to the set of closed contacts.
  void pass(const FitEvent& event) {
    cut();
    held_ = held_after(held_, event);
    stretch_.held = held_;
  }

  // The end of a chatter, merged to one closing.
  void add_merged(const FitEvent& closing) {
    add(closing);
    merged_ |= ContactSet{1} << closing.contact;
  }

  void add(FitEvent event) {
    if (event.kind == ContactEventKind::opens && contains(merged_, event.contact)) {
      event.informs = false;
      merged_ &= ~(ContactSet{1} << event.contact);
    }
    const bool possible = flight_->can_hold(held_) && flight_->can_hold(held_after(held_, event));
    if (!possible) return pass(event);
    if (empty()) stretch_.start = event.t;
    stretch_.events.push_back(event);
    held_ = held_after(held_, event);
  }

 private:
  const Flight* flight_;
  std::vector<FitStretch>* out_;
  FitStretch stretch_;
  ContactSet held_;
  ContactSet merged_ = 0;  // closed by a merged chatter
};

// Events first to last - 1 are closer together than can be distinguished.
void add_cluster(std::span<const FitEvent> events, Cutter& cutter, std::size_t& merged) {
  const FitEvent& first = events.front();
  const bool one_contact = std::all_of(events.begin(), events.end(), [&](const FitEvent& event) {
    return event.contact == first.contact;
  });
  const bool chatter = one_contact && first.impact() && !contains(cutter.held(), first.contact);
  if (chatter && events.back().kind == ContactEventKind::closes) {
    FitEvent closing = events.back();
    closing.t = first.t;
    cutter.add_merged(closing);
    merged += events.size() - 1;
    return;
  }
  // The path before determines the first event; the state after the cluster is unknown.
  cutter.add(first);
  for (const FitEvent& event : events.subspan(1)) cutter.pass(event);
  cutter.cut();
  merged += events.size() - 1;
}

}  // namespace

ContactSet FitStretch::held_before(std::size_t k) const {
  ContactSet set = held;
  for (std::size_t i = 0; i < k; ++i) set = held_after(set, events[i]);
  return set;
}

void pass(Flight& flight, const FitEvent& event, double time, PathPoint& at) {
  flight.fly(at.x, at.t, time - at.t, at.held);
  if (event.impact()) {
    flight.strike(event.contact, event.kind == ContactEventKind::closes, at.held);
  }
  at.x = flight.x();
  at.t = time;
  at.held = held_after(at.held, event);
}

FitStretch FitStretch::part(std::size_t first, std::size_t last) const {
  const auto begin = events.begin();
  return {first == 0 ? start : events[first].t,
          held_before(first),
          {begin + static_cast<std::ptrdiff_t>(first), begin + static_cast<std::ptrdiff_t>(last)}};
}

FitStretch FitStretch::without(std::size_t k) const {
  FitStretch changed = *this;
  changed.events.erase(changed.events.begin() + static_cast<std::ptrdiff_t>(k));
  return changed;
}

FitStretch FitStretch::with(std::size_t k, const FitEvent& event) const {
  FitStretch changed = *this;
  changed.events.insert(changed.events.begin() + static_cast<std::ptrdiff_t>(k), event);
  return changed;
}

double usual_interval(std::span<const ContactEvent> events) {
  std::vector<double> intervals;
  double sum = 0.0;
  for (std::size_t k = 1; k < events.size(); ++k) {
    intervals.push_back(std::max(events[k].t - events[k - 1].t, 0.0));
    sum += intervals.back();
  }
  std::sort(intervals.begin(), intervals.end());
  double shorter = 0.0;
  for (const double interval : intervals) {
    shorter += interval;
    if (2.0 * shorter >= sum) return interval;
  }
  return 0.0;
}

FitRecord fit_record(std::span<const ContactEvent> events, const IdentificationSettings& settings,
                     double close, const Flight& flight) {
  FitRecord record;
  record.interval = usual_interval(events);
  record.begins = settings.begins;
  std::vector<FitEvent> all;
  ContactSet chi = settings.closed;
  for (std::size_t k = 0; k < events.size(); ++k) {
    const ContactEvent& event = events[k];
    record.end = std::max(record.end, std::abs(event.t));
    // A contradiction is an event of a contact whose state is not known.
    const bool is_closed = contains(chi, event.contact);
    if (is_closed != (event.kind == ContactEventKind::opens)) continue;
    chi = after(chi, event);
    const bool guessed =
        std::find(settings.guessed.begin(), settings.guessed.end(), k) != settings.guessed.end();
    all.push_back({event.t, event.contact, event.kind, !guessed, k});
  }
  record.events = all.size();
  Cutter cutter(flight, settings.closed, record.stretches);
  for (std::size_t k = 1; k < all.size(); ++k) {
    if (all[k].t - all[k - 1].t < uncertain_within * close) {
      all[k].informs = all[k - 1].informs = false;
    }
  }
  for (std::size_t i = 0; i < all.size();) {
    std::size_t end = i + 1;
    while (end < all.size() && all[end].t - all[end - 1].t < close) ++end;
    if (i > 0 && in_gap(all[i - 1].t, all[i].t, settings.gaps)) cutter.cut();
    if (end == i + 1) {
      cutter.add(all[i]);
    } else {
      add_cluster(std::span(all).subspan(i, end - i), cutter, record.merged);
    }
    i = end;
  }
  cutter.cut();
  std::stable_sort(record.stretches.begin(), record.stretches.end(),
                   [](const FitStretch& a, const FitStretch& b) { return a.size() > b.size(); });
  return record;
}

}  // namespace sprag
