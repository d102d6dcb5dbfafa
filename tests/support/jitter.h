// Jittered event times.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag::test {

/// In the order of the events: a report waits for the one before.
inline std::vector<ContactEvent> jittered(std::vector<ContactEvent> events, double sigma,
                                          std::mt19937_64& engine) {
  std::normal_distribution<double> normal;
  double last = 1e-9;
  for (ContactEvent& event : events) {
    last = event.t = std::max(last, event.t + sigma * normal(engine));
  }
  return events;
}

/// Events that follow within `apart` sigma share one error, so that their order is kept.
inline std::vector<ContactEvent> jittered_together(std::vector<ContactEvent> events, double sigma,
                                                   double apart, std::mt19937_64& engine) {
  std::normal_distribution<double> normal;
  double off = 0.0, last = -1.0;
  for (ContactEvent& event : events) {
    if (event.t - last > apart * sigma) off = sigma * normal(engine);
    last = event.t;
    event.t = std::max(event.t + off, 1e-9);
  }
  return events;
}

}  // namespace sprag::test
