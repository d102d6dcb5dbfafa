#include "tools/view/raster.h"

#include <algorithm>
#include <limits>

namespace sprag::view {
namespace {

constexpr double still_closed = std::numeric_limits<double>::infinity();

}  // namespace

Raster::Raster(std::size_t contacts, std::size_t most) : most_(most), contacts_(contacts) {}

bool Raster::OfContact::closed() const {
  return !closures.empty() && closures.back().to == still_closed;
}

void Raster::add(const ContactEvent& event) {
  OfContact& of = contacts_[static_cast<std::size_t>(event.contact)];
  ++of.events;
  of.last = event.t;
  if (of.closed()) of.closures.back().to = event.t;
  if (event.kind == ContactEventKind::opens) return;
  of.closures.push_back({event.t, event.kind == ContactEventKind::closes ? still_closed : event.t});
  if (of.closures.size() > most_) of.closures.pop_front();
}

void Raster::correct(ContactSet closed, double t) {
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    OfContact& of = contacts_[i];
    const bool is_closed = contains(closed, static_cast<int>(i));
    if (is_closed && !of.closed()) of.closures.push_back({t, still_closed});
    if (!is_closed && of.closed()) of.closures.back().to = t;
  }
}

void Raster::clear() { contacts_.assign(contacts_.size(), {}); }

std::vector<std::vector<Closure>> Raster::thinned(const Window& window) const {
  std::vector<std::vector<Closure>> all(contacts_.size());
  if (!(window.from < window.to) || window.pixels < 1) return all;
  const double pixel = (window.to - window.from) / window.pixels;
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    const std::deque<Closure>& closures = contacts_[i].closures;
    // Closures do not overlap, so their ends rise, too.
    auto closure = std::partition_point(closures.begin(), closures.end(),
                                        [&](const Closure& c) { return c.to < window.from; });
    for (; closure != closures.end() && closure->from <= window.to; ++closure) {
      if (!all[i].empty() && closure->from - all[i].back().to < pixel) {
        all[i].back().to = closure->to;
      } else {
        all[i].push_back(*closure);
      }
    }
  }
  return all;
}

}  // namespace sprag::view
