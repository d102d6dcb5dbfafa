#include "tools/diagnose/diagnosis.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tools/diagnose/line_search.h"

namespace sprag {
namespace {

// Of the usual time between closings: no jitter, and the largest scatter that makes sense.
constexpr double exact = 1e-9;
constexpr double widest = 0.05;
constexpr int least_closings = 8;       // that count
constexpr int searched_closings = 250;  // that count, before all are taken
constexpr int first_closings_of_frequency = 24;
constexpr double coarse_turn = 0.7;  // by which a tried frequency turns the last event [rad]
constexpr int most_frequencies = 200;
constexpr double mirrored = 0.5;  // a share of time inside that no machine's contact can have

// Misfits of right models: with jitter the filter is a little too confident.
constexpr double usual_misfit = 1.1;
constexpr double misfit_deviations = 3.0;
// In J; a chance once in 10000 for a parameter that is right.
constexpr double significant_gain = 20.0;
// Of a second parameter; among ten of them a chance once in 200 where the first is alone.
constexpr double gain_of_second = 12.0;
constexpr double at_end = 5.0;        // deviations
constexpr double second_step = 1e-3;  // of the range

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

double largest_misfit(int count) {
  return usual_misfit + misfit_deviations * std::sqrt(2.0 / count);
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

  struct Best {
    double value, deviation, scatter;
  };

  /// Values at which J is lower than beside them, the lowest first: places to go on from, with the
  /// distance to the values beside them and the scatter that is left there.
  std::vector<Best> starts(const Parameter& parameter, std::span<const double> values,
                           double scatter) const {
    std::vector<std::pair<double, Best>> found;
    std::vector<double> J;
    for (const double value : values) J.push_back(at(with(scene_, parameter, value), scatter).J);
    const auto last = static_cast<int>(values.size()) - 1;
    const auto place = [&](int i) { return static_cast<std::size_t>(std::clamp(i, 0, last)); };
    for (int i = 0; i <= last; ++i) {
      const double here = J[place(i)];
      if (!std::isfinite(here) || (i > 0 && J[place(i - 1)] <= here) || J[place(i + 1)] < here) {
        continue;
      }
      const double step = 0.5 * (values[place(i + 1)] - values[place(i - 1)]);
      found.push_back({here, {values[place(i)], step, scatter}});
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const auto& x, const auto& y) { return x.first < y.first; });
    std::vector<Best> best;
    for (auto& [of, start] : found) {
      if (static_cast<int>(best.size()) == most_starts) break;
      const Model model = with(scene_, parameter, start.value);
      // A turned excitation turns the machine over: its gaps are zero where they should be, and
      // negative in between.
      if (parameter.cyclic &&
          predict(scene_, model, scatter, events_, true, beginning_).inside >= mirrored) {
        continue;
      }
      start.scatter = scatter_of(model, scatter);
      best.push_back(start);
    }
    return best;
  }

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
  static constexpr int most_starts = 3;
  static constexpr double ratio = 10.0;
  static constexpr double closeness = 1.1;

  const Scene& scene_;
  std::span<const ContactEvent> events_;
  Beginning beginning_;
  double least_, widest_;
};

// Denser where small mistakes lie.
std::vector<double> coarse_values(const Parameter& parameter) {
  const int half = parameter.cyclic ? 36 : 24;
  std::vector<double> values;
  for (int i = -half; i <= half; ++i) {
    const double s = static_cast<double>(i) / half;
    const double to = i < 0 ? parameter.lowest : parameter.highest;
    const double share = parameter.cyclic ? std::abs(s) : s * s;
    values.push_back(parameter.nominal + share * (to - parameter.nominal));
  }
  return values;
}

// A wrong frequency turns the phase of late events: so close together that none is passed over
// until t, and around the nominal value where there would be too many.
std::vector<double> frequencies(const Parameter& parameter, double fastest, double t) {
  const double step = coarse_turn / t * (parameter.nominal / fastest);
  const int half = std::min(most_frequencies / 2,
                            static_cast<int>((parameter.highest - parameter.nominal) / step));
  std::vector<double> values;
  for (int i = -half; i <= half; ++i) values.push_back(parameter.nominal + i * step);
  return values;
}

double fastest(const Model& model) {
  double omega = 0.0;
  for (const Force& force : model.forces) omega = std::max(omega, force.harmonic.frequency);
  for (const Contact& contact : model.contacts) omega = std::max(omega, contact.motion.frequency);
  return omega;
}

/// The first events, on which a parameter is searched before all are taken.
struct Window {
  Search search;
  double scatter;  ///< of the scene's own model
  double t;        ///< of the last event
};

/// How many places a search goes on from.
enum class Effort {
  beside,   ///< the nominal value, where the model fits as it is
  one,      ///< the best one, where another parameter is known to explain all
  several,  ///< until one fits
};

/// Searches a parameter on windows that grow; `fits` judges a model on the last one.
class Finder {
 public:
  Finder(const Scene& scene, const Parameter& parameter, std::span<const Window> windows,
         const std::function<bool(const Model&)>& fits)
      : scene_(scene), parameter_(parameter), windows_(windows), fits_(fits) {}

  Search::Best find(Effort effort) {
    std::vector<Search::Best> starts;
    if (effort != Effort::beside) starts = coarse();
    if (starts.empty()) {
      const double range = parameter_.highest - parameter_.lowest;
      starts.push_back({parameter_.nominal, nominal_step * range, windows_.front().scatter});
    }
    if (effort == Effort::one) starts.resize(1);
    for (const Search::Best& start : starts) {
      if (try_from(start)) break;
    }
    return best_;
  }

 private:
  static constexpr double nominal_step = 0.01;  // of the range
  static constexpr std::size_t most_starts = 3;

  // With the scatter of the scene's own model all values look alike near the best; with smaller
  // ones it shows how many places there are. The first is where least is left.
  std::vector<Search::Best> coarse() const {
    const std::vector<double> tried = values();
    std::vector<Search::Best> all;
    for (const double sharper : {0.1, 0.01}) {
      const Window& first = windows_.front();
      for (const Search::Best& start :
           first.search.starts(parameter_, tried, sharper * first.scatter)) {
        const bool known = std::any_of(all.begin(), all.end(), [&](const Search::Best& other) {
          return other.value == start.value;
        });
        if (!known) all.push_back(start);
      }
    }
    std::stable_sort(all.begin(), all.end(), [](const Search::Best& a, const Search::Best& b) {
      return a.scatter < b.scatter;
    });
    if (all.size() > most_starts) all.resize(most_starts);
    return all;
  }

  std::vector<double> values() const {
    return parameter_.quantity == Quantity::frequency
               ? frequencies(parameter_, fastest(scene_.model), windows_.front().t)
               : coarse_values(parameter_);
  }

  // Whether that fits, so that there is nothing more to find.
  bool try_from(const Search::Best& start) {
    Search::Best best = start;
    const auto model = [&] { return with(scene_, parameter_, best.value); };
    for (const Window& window : windows_) {
      if (&window != &windows_.front()) {
        best.scatter = window.search.scatter_of(model(), window.scatter);
      }
      if (!(best.deviation > 0.0)) best.deviation = start.deviation;
      best = window.search.refine(parameter_, best);
    }
    const double J = windows_.back().search.at(model(), best.scatter).J;
    if (!(J_ <= J)) {
      best_ = best;
      J_ = J;
    }
    return fits_(model());
  }

  const Scene& scene_;
  const Parameter& parameter_;
  std::span<const Window> windows_;
  const std::function<bool(const Model&)>& fits_;
  Search::Best best_{};
  double J_ = std::numeric_limits<double>::quiet_NaN();  // nothing tried
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
  // An end that is as good as the best says nothing, unless the best is there.
  const auto rises_to = [&](double end) {
    const double range = parameter.highest - parameter.lowest;
    const bool is_best =
        std::abs(end - best.value) < at_end * std::min(best.deviation, 0.01 * range);
    return is_best || predicted(end, best.scatter).J > J + significant_gain;
  };
  Candidate candidate;
  candidate.parameter = parameter;
  candidate.value = parameter.nominal;
  candidate.scatter = diagnosis.scatter;
  candidate.told =
      best.deviation > 0.0 && J < nominal.J + significant_gain &&
      (parameter.cyclic || (rises_to(parameter.lowest) && rises_to(parameter.highest)));
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

// By how much J falls below that of `first` at its best if a second parameter may change with it:
// by a parabola in both, and what it promises is tried.
double gain_of_two(const Search& search, const Scene& scene, const Candidate& first,
                   const Parameter& second, double scatter) {
  const auto J = [&](double x, double y) {
    Scene other = scene;
    other.model = with(scene, first.parameter, x);
    return search.at(with(other, second, y), scatter).J;
  };
  const double x = first.value;
  const double start = J(x, second.nominal);
  const double range = second.highest - second.lowest;
  const Minimum alone =
      descend([&](double y) { return J(x, y); }, {second.nominal, start, second_step * range, 0.0},
              second.lowest, second.highest);
  const double gain = start - alone.J;
  if (!(alone.deviation > 0.0) || gain > gain_of_second) return gain;
  // In units of both deviations, around where the second alone is best.
  const double dx = first.deviation;
  const double dy = std::min(alone.deviation, 0.5 * range);
  const double y = std::clamp(alone.x, second.lowest + dy, second.highest - dy);
  const double here = J(x, y);
  const double right = J(x + dx, y);
  const double left = J(x - dx, y);
  const double up = J(x, y + dy);
  const double down = J(x, y - dy);
  Eigen::Matrix2d H;
  H << right + left - 2.0 * here, 0.0, 0.0, up + down - 2.0 * here;
  H(0, 1) = H(1, 0) = J(x + dx, y + dy) - right - up + here;
  const Eigen::Vector2d slope(0.5 * (right - left), 0.5 * (up - down));
  if (!H.allFinite() || !(H.determinant() > 0.0) || !(H(0, 0) > 0.0)) return gain;
  const Eigen::Vector2d step = H.inverse() * slope;
  return std::max(gain, start - J(x - step[0] * dx, y - step[1] * dy));
}

// Without jitter there is no distribution to hold a gain against, and what fits leaves nothing.
void look_for_a_second(const Search& search, const Scene& scene,
                       std::span<const Parameter> parameters, Diagnosis& diagnosis) {
  if (!(diagnosis.jitter > 0.0) || diagnosis.explanation() == nullptr) return;
  Candidate& best = diagnosis.candidates.front();
  for (const Parameter& second : parameters) {
    const bool same = second.quantity == best.parameter.quantity &&
                      (second.contact < 0 || second.contact == best.parameter.contact);
    if (same) continue;
    if (gain_of_two(search, scene, best, second, diagnosis.resolved) > gain_of_second) {
      best.improved_by = second.name;
      return;
    }
  }
}

}  // namespace

const Candidate* Diagnosis::explanation() const {
  if (fits || candidates.empty()) return nullptr;
  const Candidate& best = candidates.front();
  const bool alone = best.told && best.fits && best.improved_by.empty();
  return alone && best.gain > significant_gain ? &best : nullptr;
}

std::vector<const Candidate*> Diagnosis::ties() const {
  std::vector<const Candidate*> ties;
  const Candidate* best = explanation();
  if (best == nullptr) return ties;
  for (const Candidate& other : candidates) {
    if (&other == best || !other.told) continue;
    const bool as_good = best->gain - other.gain < significant_gain;
    if (as_good || (other.fits && jitter == 0.0)) ties.push_back(&other);
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
  const Search on_all(scene, events, beginning, least, most);

  const Prediction own = on_all.at(scene.model, least);
  diagnosis.closings = own.count;
  diagnosis.misfit = own.misfit;
  diagnosis.unsure = own.unsure;
  diagnosis.largest_misfit = largest_misfit(own.count);
  diagnosis.fits = own.misfit <= diagnosis.largest_misfit;
  diagnosis.scatter = diagnosis.fits ? least : on_all.scatter_of(scene.model, most);
  const Prediction nominal = on_all.at(scene.model, diagnosis.scatter);

  // The first of few events, for the frequency; the last of those that are searched.
  std::vector<Window> windows;
  for (int count = first_closings_of_frequency;; count *= 2) {
    const auto some = first_closings(events, to_start + std::min(count, searched_closings));
    const Search search(scene, some, beginning, least, most);
    windows.push_back(
        {search, diagnosis.fits ? least : search.scatter_of(scene.model, most), some.back().t});
    if (some.size() == events.size() || count >= searched_closings) break;
  }
  const std::function<bool(const Model&)> fits = [&](const Model& model) {
    const Prediction of = windows.back().search.at(model, least);
    return of.misfit <= largest_misfit(of.count);
  };

  Effort effort = diagnosis.fits ? Effort::beside : Effort::several;
  const std::vector<Parameter> parameters = parameters_of(scene, nominal.length);
  for (const Parameter& parameter : parameters) {
    const std::span<const Window> all(windows);
    const bool grows = parameter.quantity == Quantity::frequency;
    Finder finder(scene, parameter, grows ? all : all.last(1), fits);
    const Search::Best first = finder.find(effort);
    const double step =
        first.deviation > 0.0 ? first.deviation : 0.01 * (parameter.highest - parameter.lowest);
    const double scatter = std::min(
        on_all.scatter_of(with(scene, parameter, first.value), first.scatter), diagnosis.scatter);
    const Search::Best best = on_all.refine(parameter, {first.value, step, scatter});
    diagnosis.candidates.push_back(
        candidate_of(on_all, scene, parameter, best, nominal, diagnosis));
    if (!diagnosis.fits && diagnosis.candidates.back().fits) effort = Effort::one;
  }
  compare(on_all, scene, diagnosis);
  look_for_a_second(on_all, scene, parameters, diagnosis);
  return diagnosis;
}

}  // namespace sprag
