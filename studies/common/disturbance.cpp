#include "studies/common/disturbance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "studies/common/random.h"

namespace sprag::common {
namespace {

bool earlier(const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; }

std::vector<ContactEvent> spurious_pulses(double rate, int contacts, double end, Random& random) {
  std::vector<ContactEvent> pulses;
  if (!(rate > 0.0)) return pulses;
  for (int contact = 0; contact < contacts; ++contact) {
    for (double t = random.exponential() / rate; t < end; t += random.exponential() / rate) {
      pulses.push_back({t, contact, ContactEventKind::pulse});
    }
  }
  std::stable_sort(pulses.begin(), pulses.end(), earlier);
  return pulses;
}

}  // namespace

std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed) {
  // A source of its own for each disturbance: one does not change the draws of another.
  Random of_times(3 * seed);
  Random of_losses(3 * seed + 1);
  Random of_pulses(3 * seed + 2);
  std::vector<ContactEvent> arrived;
  double last = 0.0;
  for (ContactEvent event : events) {
    const double noise = disturbance.jitter * of_times.normal();
    const bool missed = of_losses.uniform() < disturbance.missed;
    if (missed) continue;
    event.t = std::max(std::nextafter(last, std::numeric_limits<double>::infinity()),
                       event.t + disturbance.offset + noise);
    last = event.t;
    arrived.push_back(event);
  }
  const auto pulses = spurious_pulses(disturbance.spurious, contacts, end, of_pulses);
  std::vector<ContactEvent> merged;
  std::merge(arrived.begin(), arrived.end(), pulses.begin(), pulses.end(),
             std::back_inserter(merged), earlier);
  drop_contradicting(merged);
  std::erase_if(merged, [&](const ContactEvent& event) { return event.t > end; });
  return merged;
}

void drop_contradicting(std::vector<ContactEvent>& events) {
  ContactSet chi = 0;
  std::erase_if(events, [&](const ContactEvent& event) {
    const bool opens = event.kind == ContactEventKind::opens;
    if (contains(chi, event.contact) != opens) return true;
    chi = after(chi, event);
    return false;
  });
}

}  // namespace sprag::common
