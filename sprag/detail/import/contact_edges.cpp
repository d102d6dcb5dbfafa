#include "sprag/detail/import/contact_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace sprag {

namespace {

using enum ContactEventKind;

/// Whether `to` - `from` < `limit` by more than the rounding of the two. If false, it is false for
/// every later `to`.
bool shorter_than(double from, double to, double limit) {
  const double rounding =
      2.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(from), std::abs(to));
  return to - from < limit - rounding;
}

std::string edge_time(double t) {
  std::array<char, 32> text;
  const int length = std::snprintf(text.data(), text.size(), "t = %.9g", t);
  return {text.data(), static_cast<std::size_t>(length)};
}

double just_before(double t) { return std::nextafter(t, -std::numeric_limits<double>::infinity()); }

}  // namespace

EdgeCounts& EdgeCounts::operator+=(const EdgeCounts& other) {
  pulses += other.pulses;
  sustained += other.sustained;
  merged += other.merged;
  before_start += other.before_start;
  after_duration += other.after_duration;
  return *this;
}

std::string ContactEdges::close(double t) {
  if (any_ && shorter_than(closed_ ? last_on_ : off_, t, rules_.debounce)) {
    ++counts_.merged;
  } else if (closed_) {
    return "closes at " + edge_time(t) + ", but is closed already since " + edge_time(on_);
  } else if (any_ && on_ == t) {
    return "closes at " + edge_time(t) + ", where it has closed already";
  } else {
    now_ = std::max(now_, just_before(t));
    if (!ended_) settle_closing();
    on_ = t;
    begun_ = ended_ = false;
  }
  off_ = never;
  any_ = closed_ = true;
  last_on_ = t;
  return {};
}

std::string ContactEdges::open(double t) {
  if (!closed_) {
    if (!any_ || !shorter_than(off_, t, rules_.debounce))
      return "opens at " + edge_time(t) + ", but is open already";
    ++counts_.merged;
  }
  off_ = t;
  closed_ = false;
  return {};
}

std::string ContactEdges::impact(double t) {
  const double last = std::exchange(last_impact_, t);
  if (shorter_than(last, t, rules_.debounce)) {
    ++counts_.merged;
  } else if (t == last) {
    return "impact at " + edge_time(t) + ", where there is one already";
  } else if (add(t, pulse)) {
    ++counts_.pulses;
  }
  return {};
}

void ContactEdges::advance(double t) {
  now_ = std::max(now_, t);
  settle();
}

void ContactEdges::settle() {
  if (ended_) return;
  if (!closed_) {
    if (!shorter_than(off_, now_, rules_.debounce)) settle_closing();
  } else if (!begun_ && now_ >= 0.0 && !shorter_than(on_, now_, rules_.pulse_shorter_than)) {
    // The opening comes after now, so that the contact is sustained.
    begun_ = true;
    if (add(std::max(on_, 0.0), closes)) ++counts_.sustained;
  }
}

// The contact is open, and no edge belongs to it any more.
void ContactEdges::settle_closing() {
  ended_ = true;
  if (!begun_) {
    begun_ = true;
    if (on_ == off_ || shorter_than(on_, off_, rules_.pulse_shorter_than)) {
      if (add(on_, pulse)) ++counts_.pulses;
      return;
    }
    if (on_ < 0.0 && off_ <= 0.0) {
      counts_.before_start += 2;
      return;
    }
    if (add(std::max(on_, 0.0), closes)) ++counts_.sustained;
  }
  if (off_ < never) add(off_, opens);
}

double ContactEdges::watermark() const {
  if (ended_ || (closed_ && begun_)) return now_;
  return std::min(now_, just_before(begun_ ? off_ : std::max(on_, 0.0)));
}

std::vector<ContactEvent> ContactEdges::take_events() { return std::exchange(events_, {}); }

bool ContactEdges::add(double t, ContactEventKind kind) {
  if (t < 0.0) {
    ++counts_.before_start;
  } else if (t > rules_.duration) {
    ++counts_.after_duration;
  } else {
    events_.push_back({t, contact_, kind});
    return true;
  }
  return false;
}

}  // namespace sprag
