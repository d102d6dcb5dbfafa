#include "sprag/detail/identification/record_checks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "sprag/detail/identification/search.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

std::vector<double> closings_of(std::span<const ContactEvent> events) {
  std::vector<double> times;
  for (const ContactEvent& event : events) {
    if (event.kind != ContactEventKind::opens) times.push_back(event.t);
  }
  return times;
}

}  // namespace

std::size_t closings_per_period(std::span<const ContactEvent> events, double jitter) {
  constexpr std::size_t longest = 4;
  constexpr double in_jitters = 2.0, usual = 1e-3, largest = 1e-2;
  const std::vector<double> times = closings_of(events);
  for (std::size_t p = 1; p <= longest && times.size() > 4 * p + 2; ++p) {
    const std::size_t n = times.size() - p;
    double period = 0.0, squares = 0.0;
    for (std::size_t k = 0; k < n; ++k)
      period += (times[k + p] - times[k]) / static_cast<double>(n);
    for (std::size_t k = 0; k < n; ++k) squares += square(times[k + p] - times[k] - period);
    const double off = std::sqrt(0.5 * squares / static_cast<double>(n));
    const double interval = period / static_cast<double>(p);
    const double allowed = jitter > 0.0 ? in_jitters * jitter : usual * interval;
    if (off < std::clamp(allowed, negligible_scatter * interval, largest * interval)) return p;
  }
  return 0;
}

bool has_merged_bounces(const Scene& scene, std::span<const ContactEvent> events) {
  constexpr double sooner = 0.5, expected = 10.0;
  const std::vector<double> recorded = closings_of(events);
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < recorded.size(); ++k) {
    least = std::min(least, recorded[k] - recorded[k - 1]);
  }
  if (!(least > 0.0) || recorded.size() < 2) return false;
  std::vector<ContactEvent> of_model;
  try {
    Master master(scene.model, scene.truth.start);
    master.advance(at(2.0 * recorded.back()), of_model, 4 * recorded.size());
  } catch (const ModelError&) {
    return false;
  }
  const std::vector<double> times = closings_of(of_model);
  // A chatter counts as one impact, which the sensor would report.
  std::size_t near = 0, distinct = 1;
  for (std::size_t k = 1; k + 1 < times.size(); ++k) {
    if (!(times[k + 1] - times[k] > least)) continue;
    ++distinct;
    if (times[k] - times[k - 1] < sooner * least) ++near;
  }
  const double share = static_cast<double>(near) / static_cast<double>(distinct);
  return share * static_cast<double>(recorded.size()) > expected;
}

}  // namespace sprag
