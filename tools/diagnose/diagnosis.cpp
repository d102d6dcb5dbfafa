#include "tools/diagnose/diagnosis.h"

#include <algorithm>
#include <cmath>

#include "tools/diagnose/line_search.h"

namespace sprag {
namespace {

// Of the usual time between closings: no jitter, and the largest scatter that makes sense.
constexpr double exact = 1e-9;
constexpr double widest = 0.05;
constexpr int least_closings = 8;       // that count
constexpr int searched_closings = 250;  // that count, before all are taken
constexpr double coarse_step = 0.01;    // of the range
constexpr double mirrored = 0.5;        // a share of time inside that no machine's contact can have

// Misfits of right models: with jitter the filter is a little too confident.
constexpr double usual_misfit = 1.1;
constexpr double misfit_deviations = 3.0;
// In J; a chance once in 10000 for a parameter that is right.
constexpr double significant_gain = 20.0;
constexpr double enough_explained = 0.9;

/// Of the times between closings, each weighted by itself: bounces of a chatter hardly count.
double usual_flight(std::span<const ContactEvent> events) {
  double last = events.front().t;
  double sum = 0.0;
  double squares = 0.0;
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    if (closings_of(of_one) == 0) return;
    const double flight = of_one.front().t - last;
    last = of_one.front().t;
    sum += flight;
    squares += flight * flight;
  });
  return sum > 0.0 ? squares / sum : 0.0;
}

std::span<const ContactEvent> first_closings(std::span<const ContactEvent> events, int enough) {
  std::size_t count = 0;
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    if (enough <= 0) return;
    enough -= closings_of(of_one);
    count += of_one.size();
  });
  return events.first(count);
}

/// The best value of a parameter on some of the events.
class Search {
 public:
  /// Scatters from `least` to `most` are tried.
  Search(const Scene& scene, std::span<const ContactEvent> events, const Beginning& beginning,
         double least, double most)
      : scene_(scene), events_(events), beginning_(beginning), least_(least), widest_(most) {}

  Prediction at(const Model& model, double scatter) const {
    return predict(scene_, model, scatter, events_, false, beginning_);
  }

  /// The smallest scatter with which the model's misfit is at most 1, below a larger one near
  /// `from` with which it is as well.
  double scatter_of(const Model& model, double from) const {
    const auto follows = [&](double scatter) { return at(model, scatter).misfit <= 1.0; };
    double high = std::clamp(from, least_, widest_);
    while (high < widest_ && !follows(high)) high = std::min(ratio * high, widest_);
    double low = high;
    while (low > least_) {
      low = std::max(high / ratio, least_);
      if (!follows(low)) break;
      high = low;
    }
    while (high > least_ && high > closeness * low) {
      const double middle = std::sqrt(low * high);
      (follows(middle) ? high : low) = middle;
    }
    return high;
  }

  /// The place of the lowest J at this scatter, on a grid that is denser where small mistakes lie.
  double coarse(const Parameter& parameter, double scatter) const {
    const int half = parameter.cyclic ? 36 : 24;
    std::vector<std::pair<double, double>> found;
    for (int i = -half; i <= half; ++i) {
      const double s = static_cast<double>(i) / half;
      const double to = i < 0 ? parameter.lowest : parameter.highest;
      const double share = parameter.cyclic ? std::abs(s) : s * s;
      const double value = parameter.nominal + share * (to - parameter.nominal);
      found.emplace_back(at(with(scene_, parameter, value), scatter).J, value);
    }
    std::sort(found.begin(), found.end());
    if (!parameter.cyclic) return found.front().second;
    // A turned excitation turns the machine over: its gaps are zero where they should be, and
    // negative in between.
    for (const auto& [J, value] : found) {
      const Model model = with(scene_, parameter, value);
      if (predict(scene_, model, scatter, events_, true, beginning_).inside < mirrored)
        return value;
    }
    return parameter.nominal;
  }

  struct Best {
    double value, deviation, scatter;
  };

  /// Downhill from `from`, as long as the scatter that is left falls.
  Best refine(const Parameter& parameter, Best from) const {
    Best best = from;
    const auto J = [&](double value) { return at(with(scene_, parameter, value), best.scatter).J; };
    double step = from.deviation;
    for (int round = 0; round < most_rounds; ++round) {
      const Minimum minimum =
          descend(J, {best.value, J(best.value), step, 0.0}, parameter.lowest, parameter.highest);
      best.value = minimum.x;
      best.deviation = minimum.deviation;
      const double left = scatter_of(with(scene_, parameter, best.value), best.scatter);
      if (!(left < 0.9 * best.scatter)) break;
      step = std::min(minimum.step, minimum.deviation) * left / best.scatter;
      best.scatter = left;
    }
    return best;
  }

 private:
  static constexpr int most_rounds = 40;
  static constexpr double ratio = 10.0;
  static constexpr double closeness = 1.1;

  const Scene& scene_;
  std::span<const ContactEvent> events_;
  Beginning beginning_;
  double least_, widest_;
};

double explained(double before, double left, double jitter) {
  const double all = before * before - jitter * jitter;
  if (!(all > 0.0)) return 0.0;
  return std::clamp(1.0 - (left * left - jitter * jitter) / all, 0.0, 1.0);
}

Candidate candidate_of(const Search& search, const Scene& scene, const Parameter& parameter,
                       const Search::Best& best, const Prediction& nominal,
                       const Diagnosis& diagnosis) {
  const auto predicted = [&](double value, double scatter) {
    return search.at(with(scene, parameter, value), scatter);
  };
  const double J = predicted(best.value, best.scatter).J;
  const double J_at_ends = std::min(predicted(parameter.lowest, best.scatter).J,
                                    predicted(parameter.highest, best.scatter).J);
  Candidate candidate;
  candidate.parameter = parameter;
  candidate.value = parameter.nominal;
  candidate.scatter = diagnosis.scatter;
  candidate.told = best.deviation > 0.0 && J < nominal.J + significant_gain &&
                   (parameter.cyclic || J_at_ends > J + significant_gain);
  if (!candidate.told) return candidate;
  candidate.value = best.value;
  candidate.deviation = best.deviation;
  candidate.scatter = best.scatter;
  candidate.gain = nominal.J - J;
  candidate.fits = predicted(best.value, diagnosis.resolved).misfit <= diagnosis.largest_misfit;
  candidate.sensitivity =
      best.scatter / (best.deviation * std::sqrt(static_cast<double>(nominal.count)));
  candidate.explained = explained(diagnosis.scatter, best.scatter, diagnosis.resolved);
  return candidate;
}

// The best first, and all at the scatter of the sharpest.
void compare(const Search& search, const Scene& scene, Diagnosis& diagnosis) {
  std::stable_sort(diagnosis.candidates.begin(), diagnosis.candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
  diagnosis.common_scatter = diagnosis.scatter;
  for (const Candidate& candidate : diagnosis.candidates) {
    diagnosis.common_scatter = std::min(diagnosis.common_scatter, candidate.scatter);
    // What is as good as exact has no distribution to hold a gain against.
    if (diagnosis.jitter > 0.0 && candidate.gain > significant_gain) diagnosis.fits = false;
  }
  diagnosis.misfit_before = search.at(scene.model, diagnosis.common_scatter).misfit;
  for (Candidate& candidate : diagnosis.candidates) {
    const Model model = with(scene, candidate.parameter, candidate.value);
    candidate.misfit = search.at(model, diagnosis.common_scatter).misfit;
  }
}

}  // namespace

const Candidate* Diagnosis::explanation() const {
  if (fits || candidates.empty()) return nullptr;
  const Candidate& best = candidates.front();
  const bool enough = best.fits || best.explained >= enough_explained;
  return best.told && best.gain > significant_gain && enough ? &best : nullptr;
}

std::vector<const Candidate*> Diagnosis::ties() const {
  std::vector<const Candidate*> ties;
  const Candidate* best = explanation();
  if (best == nullptr) return ties;
  for (const Candidate& other : candidates) {
    if (&other == best || !other.told) continue;
    const bool as_good = best->gain - other.gain < significant_gain;
    if (as_good || (best->fits && other.fits && jitter == 0.0)) ties.push_back(&other);
  }
  return ties;
}

Diagnosis diagnose(const Scene& scene, std::span<const ContactEvent> events, double jitter,
                   const Beginning& beginning) {
  const int to_start = closings_to_start(scene);
  const int closings = closings_of(events);
  if (closings - to_start < least_closings) {
    throw TooFewEvents("contacts close at " + std::to_string(closings) +
                       " instants; this machine's state takes " + std::to_string(to_start) +
                       " and its model " + std::to_string(least_closings) + " more");
  }
  Diagnosis diagnosis;
  diagnosis.scene = scene.name;
  diagnosis.from = events.front().t;
  diagnosis.to = events.back().t;
  diagnosis.only_frequency = only_frequency(scene.model);
  diagnosis.jitter = jitter;
  const double flight = usual_flight(events);
  const double least = std::max({jitter, exact * flight, scene.model.chatter_time});
  diagnosis.resolved = least;
  const double most = std::max(widest * flight, least);
  const auto some = first_closings(events, to_start + searched_closings);
  const Search on_all(scene, events, beginning, least, most);
  const Search on_some(scene, some, beginning, least, most);

  const Prediction own = on_all.at(scene.model, least);
  diagnosis.closings = own.count;
  diagnosis.misfit = own.misfit;
  diagnosis.unsure = own.unsure;
  diagnosis.largest_misfit = usual_misfit + misfit_deviations * std::sqrt(2.0 / own.count);
  diagnosis.fits = own.misfit <= diagnosis.largest_misfit;
  diagnosis.scatter = diagnosis.fits ? least : on_all.scatter_of(scene.model, most);
  const double first_scatter = diagnosis.fits ? least : on_some.scatter_of(scene.model, most);
  const Prediction nominal = on_all.at(scene.model, diagnosis.scatter);

  for (const Parameter& parameter : parameters_of(scene, nominal.length)) {
    const double range = parameter.highest - parameter.lowest;
    const Search::Best first = on_some.refine(
        parameter, {on_some.coarse(parameter, first_scatter), coarse_step * range, first_scatter});
    const double step = first.deviation > 0.0 ? first.deviation : coarse_step * range;
    const double scatter = std::min(
        on_all.scatter_of(with(scene, parameter, first.value), first.scatter), diagnosis.scatter);
    const Search::Best best = on_all.refine(parameter, {first.value, step, scatter});
    diagnosis.candidates.push_back(
        candidate_of(on_all, scene, parameter, best, nominal, diagnosis));
  }
  compare(on_all, scene, diagnosis);
  return diagnosis;
}

}  // namespace sprag
