#include "sprag/detail/bound/event_cluster.h"

#include <algorithm>
#include <cmath>

namespace sprag {

void EventCluster::close_windows(double t) {
  const auto end =
      std::remove_if(windows.begin(), windows.begin() + static_cast<std::ptrdiff_t>(open),
                     [t](const OpenWindow& window) { return window.end <= t; });
  open = static_cast<std::size_t>(end - windows.begin());
}

bool EventCluster::add(const OpenWindow& window) {
  if (open == windows.size()) {
    // Two windows of one contact become one that ends with the later.
    OpenWindow& last = windows[open - 1];
    if (last.contact != window.contact) return false;
    last.end = std::max(last.end, window.end);
    last.J += window.J;
    return true;
  }
  windows[open++] = window;
  return true;
}

double EventCluster::open_J(double t) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < open; ++k) {
    if (windows[k].end >= t) sum += windows[k].J;
  }
  return sum;
}

double EventCluster::shift(double G, double turn, double until, double delta) const {
  if (events < 2) return D;
  const double T = until - first_t + delta;
  const double left = 1.0 - 2.0 * turn * T;
  if (left <= 0.0) return D;
  const double by_momentum =
      (std::sqrt(0.5 * G) * impulse + 2.0 * (first_speed + acceleration * T) / std::sqrt(2.0 * G)) /
      left;
  return std::min(D, by_momentum);
}

}  // namespace sprag
