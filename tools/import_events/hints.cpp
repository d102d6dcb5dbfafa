#include "tools/import_events/hints.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>

namespace sprag {
namespace {

constexpr double short_contact = 1e-3;    // [s]
constexpr double share_of_median = 1e-3;  // of the intervals between closings
// Gaps between batches are longer than those within a batch by more than this factor.
constexpr double apart = 10.0;
constexpr std::size_t fewest_small = 3;
constexpr std::size_t fewest_batches = 12;
constexpr double smallest_share = 0.1;  // of closings in shared batches
// Threshold of the mean of cos(2 pi d / P) over the distances d of batches, which is 1 if all are
// multiples of P. For 12 random distances a search exceeds it with a probability of about 0.1 %.
constexpr double coherent = 0.95;
constexpr double longest_distance = 50.0;  // relative to the shortest; longer ones are not used
constexpr std::size_t most_distances = 2000;

std::string readable(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Times of one contact [s].
struct Spans {
  std::vector<double> lengths;    // of sustained contacts
  std::vector<double> intervals;  // from a closing to the next
  std::vector<double> pauses;     // from an opening to the next closing
};

Spans spans_of(const Import& import, int contact) {
  Spans spans;
  double on = -1.0, off = -1.0;
  for (const ContactEvent& event : import.events) {
    if (event.contact != contact) continue;
    if (event.kind == ContactEventKind::opens) {
      if (on >= 0.0) spans.lengths.push_back(event.t - on);
      off = event.t;
      continue;
    }
    if (on >= 0.0) spans.intervals.push_back(event.t - on);
    if (off >= 0.0) spans.pauses.push_back(event.t - off);
    on = event.t;
    off = event.kind == ContactEventKind::pulse ? event.t : -1.0;
  }
  return spans;
}

struct Batch {
  double begin = 0.0;
  std::size_t closings = 0;
  std::uint64_t contacts = 0;
};

std::vector<Batch> batches_of(std::span<const Closing> closings, double between) {
  std::vector<Batch> batches;
  double last = 0.0;
  for (const Closing& closing : closings) {
    if (batches.empty() || closing.t - last >= between) batches.push_back({closing.t});
    ++batches.back().closings;
    batches.back().contacts |= std::uint64_t{1} << closing.contact;
    last = closing.t;
  }
  return batches;
}

// Finds the largest jump in the sorted gaps, as a factor, and returns the smallest gap above it.
std::optional<double> smallest_between(std::vector<double> gaps) {
  std::sort(gaps.begin(), gaps.end());
  std::optional<double> between;
  double largest = apart;
  for (std::size_t i = fewest_small; i + fewest_batches <= gaps.size(); ++i) {
    if (!(gaps[i] > largest * gaps[i - 1])) continue;
    between = gaps[i];
    if (gaps[i - 1] == 0.0) break;
    largest = gaps[i] / gaps[i - 1];
  }
  return between;
}

double coherence(const std::vector<double>& distances, double frequency) {
  double sum = 0.0;
  for (const double d : distances) sum += std::cos(2.0 * std::numbers::pi * d * frequency);
  return sum / static_cast<double>(distances.size());
}

// The longest period of which all distances are multiples; 0: none.
double common_period(const std::vector<double>& distances) {
  const double shortest = *std::min_element(distances.begin(), distances.end());
  std::vector<double> near;
  for (const double d : distances) {
    if (d <= longest_distance * shortest && near.size() < most_distances) near.push_back(d);
  }
  if (near.size() + 1 < fewest_batches) return 0.0;
  const double step = 0.02 / *std::max_element(near.begin(), near.end());
  double best = 0.0, found = 0.0;
  for (double frequency = 0.8 / shortest; frequency <= 4.0 / shortest; frequency += step) {
    const double now = coherence(near, frequency);
    if (now > best) {
      best = now;
      found = frequency;
    } else if (best >= coherent && now < 0.9 * best) {
      break;
    }
  }
  return best >= coherent ? 1.0 / found : 0.0;
}

}  // namespace

std::vector<std::string> hints_at_bounces(const Import& import) {
  std::vector<std::string> hints;
  for (const ContactFigures& figures : import.figures) {
    if (figures.sustained == 0) continue;
    const Spans spans = spans_of(import, figures.contact);
    const double limit = std::max(short_contact, share_of_median * median(spans.intervals));
    const auto shorter = [limit](const std::vector<double>& times) {
      return std::count_if(times.begin(), times.end(), [limit](double t) { return t < limit; });
    };
    const auto brief = shorter(spans.lengths);
    if (brief == 0) continue;
    std::string hint = "contact " + std::to_string(figures.contact + 1) + ": " +
                       std::to_string(brief) + " of " + std::to_string(spans.lengths.size()) +
                       " sustained contacts last less than " + readable(limit) + " s (median " +
                       readable(median(spans.lengths)) + " s)";
    if (const auto quick = shorter(spans.pauses); quick > 0) {
      hint += ", and " + std::to_string(quick) + " closings follow an opening as closely";
    }
    hints.push_back(
        hint +
        ". Impacts are as short, and electrical contacts bounce: "
        "--pulse-shorter-than T makes impacts of contacts shorter than T, --debounce T "
        "one contact of those that follow within T. A burst of hits of a stiff structure "
        "that lasts longer than a twentieth of the period of the scene's fastest mode "
        "is a sustained contact, not an impact (check_scene names such scenes)");
  }
  return hints;
}

std::optional<Batches> find_batches(std::span<const Closing> closings) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < closings.size(); ++i)
    gaps.push_back(closings[i].t - closings[i - 1].t);
  const std::optional<double> between = smallest_between(gaps);
  if (!between) return std::nullopt;
  const std::vector<Batch> batches = batches_of(closings, *between);
  Batches found;
  std::size_t shared = 0, of_several_contacts = 0;
  std::vector<double> distances;
  for (std::size_t i = 0; i < batches.size(); ++i) {
    if (i > 0) distances.push_back(batches[i].begin - batches[i - 1].begin);
    if (batches[i].closings < 2) continue;
    ++shared;
    found.events += batches[i].closings;
    of_several_contacts += (batches[i].contacts & (batches[i].contacts - 1)) != 0 ? 1 : 0;
  }
  if (shared < fewest_small || distances.size() + 1 < fewest_batches ||
      static_cast<double>(found.events) < smallest_share * static_cast<double>(closings.size())) {
    return std::nullopt;
  }
  // A contact that closes several times in a batch may be bouncing instead.
  const bool at_one_instant =
      std::none_of(gaps.begin(), gaps.end(), [&](double g) { return g > 0.0 && g < *between; });
  const bool impacts =
      std::all_of(closings.begin(), closings.end(), [](const Closing& c) { return c.impact; });
  if (!at_one_instant && !impacts && 5 * of_several_contacts < shared) return std::nullopt;
  found.period = common_period(distances);
  if (found.period == 0.0) return std::nullopt;
  return found;
}

std::string to_text(const Batches& batches, std::size_t closings) {
  const std::string period = readable(batches.period);
  return "time stamps come in batches: " + std::to_string(batches.events) + " of " +
         std::to_string(closings) +
         " closings share a batch with others, and batches are multiples of " + period +
         " s apart, as of a sensor that is read every " + period + " s. Its stamps are up to " +
         period +
         " s late and never early, which no jitter describes. Stamp events where they arise, or "
         "read "
         "the sensor more often; at the least give --offset " +
         readable(0.5 * batches.period) +
         " s more and the scene events.jitter = " + readable(batches.period / std::sqrt(12.0));
}

}  // namespace sprag
