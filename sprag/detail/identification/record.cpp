#include "sprag/detail/identification/record.h"

#include <algorithm>

namespace sprag {
namespace {

// Impacts number first to last - 1. A piece that loses its first impacts starts at its first
// remaining one.
Stretch piece_of(const Stretch& stretch, std::size_t first, std::size_t last) {
  const auto begin = stretch.impacts.begin();
  Stretch piece = {
      stretch.start,
      {begin + static_cast<std::ptrdiff_t>(first), begin + static_cast<std::ptrdiff_t>(last)},
      stretch.closed,
      stretch.held};
  if (first > 0) {
    Impact& impact = piece.impacts.front();
    piece.start = impact.t;
    piece.closed = piece.held = impact.held;
    impact.passed.clear();
  }
  return piece;
}

// Appends a stretch, in pieces of at most `longest` impacts.
void append_in_pieces(const Stretch& stretch, std::size_t longest, std::size_t fewest,
                      Stretches& stretches) {
  if (stretch.equations() < fewest) return;
  const std::size_t pieces = (stretch.size() + longest - 1) / longest;
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::size_t first = i * stretch.size() / pieces;
    const std::size_t last = (i + 1) * stretch.size() / pieces;
    stretches.push_back(piece_of(stretch, first, last));
  }
}

class Cutter {
 public:
  Cutter(std::span<const ContactEvent> events, const RecordSettings& settings, std::size_t fewest)
      : events_(events),
        settings_(settings),
        fewest_(fewest),
        chi_(settings.closed),
        inside_(settings.closed),
        flies_(settings.closed == 0) {
    now_.start = settings.begins;
  }

  Stretches run();

 private:
  struct Happening {
    std::size_t first, last;  // range of events of one instant
    std::size_t hit;          // event of the contact with an impact; `last` if there is none
    bool single;              // at most one contact has an impact; all other events are openings
    ContactSet staying;       // contacts closed after it
  };

  enum class Known { yes, not_before, no };

  Known known(double t);
  Happening happening(std::size_t first) const;
  bool pass(const Happening& of);
  void cut_at(const Happening& of);
  bool can_follow(const Happening& of) const;
  bool ends_a_chatter(std::size_t i) const;
  void begin(double t, ContactSet closed, ContactSet held);
  void add_impact(const Happening& of, ContactSet staying);
  void end();

  // An event within `close` of another may belong to the other's impact.
  bool is_alone(const Happening& of) const {
    const double t = events_[of.first].t;
    return (of.first == 0 || t - events_[of.first - 1].t >= settings_.close) &&
           (of.last == events_.size() || events_[of.last].t - t >= settings_.close);
  }
  bool is_near_a_hit(double t) const { return last_hit_ && t - last_hit_->t < settings_.close; }

  std::span<const ContactEvent> events_;
  const RecordSettings& settings_;
  std::size_t fewest_;
  Stretches stretches_;
  Stretch now_;
  std::vector<Passage> passed_;             // since the last impact
  const ContactEvent* last_hit_ = nullptr;  // of now_
  ContactSet chi_, inside_;  // closed; closed since the beginning, so the machine may be inside
  bool flies_;               // now_ can be continued
  std::size_t gap_ = 0;      // first gap of the record that is not over
};

Stretches Cutter::run() {
  for (std::size_t first = 0; first < events_.size();) {
    const Happening of = happening(first);
    const double t = events_[first].t;
    const Known here = known(t);
    if (here != Known::yes) {
      end();
      inside_ = chi_;
    }
    if (here != Known::no && !pass(of)) cut_at(of);
    chi_ = of.staying;
    inside_ = here != Known::no && t > settings_.begins ? inside_ & chi_ : chi_;
    first = of.last;
  }
  end();
  return std::move(stretches_);
}

// Whether all events between the previous call's time and t are known. t must not decrease.
Cutter::Known Cutter::known(double t) {
  Known known = Known::yes;
  for (; gap_ < settings_.gaps.size() && settings_.gaps[gap_].from <= t; ++gap_) {
    const EventGap& gap = settings_.gaps[gap_];
    if (!(gap.from < gap.to)) continue;
    if (t <= gap.to) return Known::no;
    known = Known::not_before;
  }
  return known;
}

Cutter::Happening Cutter::happening(std::size_t first) const {
  Happening of{first, first, 0, true, chi_};
  // Several events of one contact at one instant are consecutive.
  ContactSet known = 0;
  while (of.last < events_.size() && events_[of.last].t == events_[first].t &&
         !contains(known, events_[of.last].contact)) {
    known |= bit(events_[of.last++].contact);
  }
  of.hit = of.last;
  for (std::size_t j = first; j < of.last; ++j) {
    const ContactEvent& event = events_[j];
    const bool opens = event.kind == ContactEventKind::opens;
    if (opens != contains(chi_, event.contact) || (!opens && of.hit != of.last)) of.single = false;
    if (!opens) of.hit = j;
    of.staying = after(of.staying, event);
  }
  return of;
}

void Cutter::begin(double t, ContactSet closed, ContactSet held) {
  now_ = {t, {}, closed, held};
  passed_.clear();
  last_hit_ = nullptr;
  flies_ = true;
}

void Cutter::add_impact(const Happening& of, ContactSet staying) {
  const ContactEvent& event = events_[of.hit];
  now_.impacts.push_back({event.t, event.contact, true, of.hit, chi_, staying, std::move(passed_)});
  passed_.clear();
  last_hit_ = &event;
}

void Cutter::end() {
  append_in_pieces(now_, settings_.longest, fewest_, stretches_);
  now_.impacts.clear();
  passed_.clear();
  flies_ = false;
}

bool Cutter::can_follow(const Happening& of) const {
  if (!of.single || inside_ != 0) return false;
  if (chi_ == 0 && of.staying == 0) return of.last == of.first + 1;
  const ContactEvent& event = events_[of.first];
  if (!settings_.can_follow || !(event.t > settings_.begins)) return false;
  return of.hit == of.last || settings_.can_follow(events_[of.hit].contact, chi_, of.staying);
}

// Whether event i is one of the last bounces of a chatter, each within `close` of the next.
bool Cutter::ends_a_chatter(std::size_t i) const {
  for (std::size_t j = i; j < events_.size(); ++j) {
    if (events_[j].contact != events_[i].contact) return false;
    if (j > i && events_[j].t - events_[j - 1].t >= settings_.close) return false;
    if (events_[j].kind == ContactEventKind::closes) return true;
  }
  return false;
}

// Continues the stretch through an instant. Returns false if that is not possible.
bool Cutter::pass(const Happening& of) {
  if (!can_follow(of)) return false;
  const double t = events_[of.first].t;
  if (of.hit == of.last) {
    if (!flies_ || !is_alone(of)) return false;
    passed_.push_back({t, -1, of.staying});
    return true;
  }
  const ContactEvent& event = events_[of.hit];
  if (flies_ && is_near_a_hit(t)) {
    const bool bounces = event.contact == last_hit_->contact && ends_a_chatter(of.hit);
    if (!settings_.can_follow || !(settings_.exact || bounces)) return false;
    passed_.push_back({t, event.contact, of.staying});
    last_hit_ = &event;
    return true;
  }
  if (!flies_) begin(t, chi_, chi_);
  add_impact(of, of.staying);
  return true;
}

void Cutter::cut_at(const Happening& of) {
  const ContactEvent& event = events_[of.first];
  const bool only = of.last == of.first + 1;
  const bool near = is_near_a_hit(event.t);
  // A sustained closing is an impact like any other, but the stretch ends with it.
  if (only && event.kind == ContactEventKind::closes && chi_ == 0 && flies_ &&
      !now_.impacts.empty() && !near) {
    add_impact(of, 0);
  }
  end();
  if (of.staying != 0) return;
  const bool releases = only && is_alone(of) && event.kind == ContactEventKind::opens &&
                        chi_ == bit(event.contact) && inside_ == 0;
  begin(event.t, releases ? chi_ : 0, 0);
  if (only && event.kind == ContactEventKind::pulse && chi_ == 0) add_impact(of, 0);
}

}  // namespace

Stretches cut(std::span<const ContactEvent> events, const RecordSettings& settings,
              std::size_t fewest) {
  return Cutter(events, settings, fewest).run();
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
      parts.push_back(piece_of(stretch, from - at, to - at));
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
