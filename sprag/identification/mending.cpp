#include "sprag/identification/mending.h"

#include <algorithm>
#include <cmath>

#include "sprag/identification/free_flight.h"
#include "sprag/identification/projection.h"
#include "sprag/identification/search.h"

namespace sprag {
namespace {

constexpr double gate = 7.0;          // of what predictions are usually off
constexpr double outlier = 4.5;       // of what the jitter does to one impact
constexpr double exact = 1e-9;        // of the usual interval: no jitter
constexpr double most_mended = 0.35;  // of the events; a path that needs more is none
// One of so many events at most is left out as an outlier, or for coming before the path.
constexpr std::size_t most_left_out = 8;

struct Followed {
  Stretch measured;  // with guesses where an event is missing
  Likelihood solution;
  std::vector<std::size_t> spurious;
  int missing = 0;
};

bool fits(const Likelihood& solution, double jitter, double most) {
  if (!solution.values.allFinite() || !std::isfinite(solution.squares)) return false;
  for (const Eigen::VectorXd& gamma : solution.gamma) {
    if (!(gamma.maxCoeff() < 0.0)) return false;
  }
  return solution.squares <= most * square(jitter) * std::max(solution.freedom, 1);
}

// Goes on from a solution for the first impacts of `all`, which end before number `next`.
class Follower {
 public:
  Follower(const MachineFamily& family, double jitter) : family_(family), jitter_(jitter) {}

  bool follow(const std::vector<Impact>& all, std::size_t next, Followed& followed);

 private:
  void stand(const Followed& followed);
  bool refit(Followed& followed);

  const MachineFamily& family_;
  double jitter_;
  Machine machine_;
  Eigen::VectorXd inputs_, y_, u_;
  double t_ = 0.0;
};

// At the end of the solution's path, behind its last impact.
void Follower::stand(const Followed& followed) {
  const Likelihood& solution = followed.solution;
  machine_ = family_.at(solution.values);
  inputs_ = family_.inputs(solution.values);
  Flights flights;
  Harmonics harmonics;
  flights.set(machine_, solution.path);
  harmonics.set(machine_.frequencies, solution.path);
  Path path;
  sprag::follow(machine_, flights, harmonics, solution.path[0], 0, solution.x0[0], inputs_, path);
  y_ = path.y;
  u_ = path.u;
  t_ = solution.path[0].impacts.back().t;
}

bool Follower::refit(Followed& followed) {
  Likelihood start = followed.solution;
  const std::size_t known = start.path[0].size();
  for (std::size_t k = known; k < followed.measured.size(); ++k) {
    start.path[0].impacts.push_back(followed.measured.impacts[k]);
  }
  Likelihood next = maximize_likelihood(family_, {followed.measured}, std::move(start));
  if (!fits(next, jitter_, 4.0)) return false;
  followed.solution = std::move(next);
  stand(followed);
  return true;
}

bool Follower::follow(const std::vector<Impact>& all, std::size_t next, Followed& followed) {
  constexpr int between_fits = 4;
  constexpr int most_in_a_row = 4;
  stand(followed);
  double off = 30.0 * jitter_;
  int since_fit = 0, in_a_row = 0;
  const double most = most_mended * static_cast<double>(all.size());
  while (next < all.size()) {
    if (static_cast<double>(followed.spurious.size()) + followed.missing > most ||
        in_a_row > most_in_a_row) {
      return false;
    }
    const Impact& event = all[next];
    const double wide = gate * std::max(off, 2.0 * jitter_);
    const FreeFlight flight(machine_, inputs_);
    const auto expected = flight.next_impact(y_, u_, t_, event.t + wide);
    if (!expected) {
      followed.spurious.push_back(event.event);
      ++next;
      ++in_a_row;
      continue;
    }
    const bool is_it =
        expected->contact == event.contact && std::abs(expected->t - event.t) <= wide;
    if (!is_it && expected->t > event.t) {
      // Of another contact, a little later: this one is not expected.
      followed.spurious.push_back(event.event);
      ++next;
      ++in_a_row;
      continue;
    }
    Impact impact = is_it ? event : *expected;
    flight.move(impact.t - t_, y_, u_);
    flight.hit(impact.contact, impact.t, u_);
    t_ = impact.t;
    if (is_it) {
      off = std::sqrt(0.8 * off * off + 0.2 * square(expected->t - event.t));
      ++next;
      in_a_row = 0;
    } else {
      ++followed.missing;
      ++in_a_row;
    }
    followed.measured.impacts.push_back(impact);
    if (++since_fit >= between_fits) {
      if (!refit(followed)) return false;
      since_fit = 0;
    }
  }
  return refit(followed);
}

// A solution for impacts number `first` to first + size - 1.
bool start_at(const MachineFamily& family, const std::vector<Impact>& all, double start,
              std::size_t first, std::size_t size, std::optional<double> jitter, double interval,
              Followed& followed, double& of) {
  const auto begin = all.begin() + static_cast<std::ptrdiff_t>(first);
  followed = {};
  followed.measured = {first == 0 ? start : begin->t,
                       {begin, begin + static_cast<std::ptrdiff_t>(size)}};
  const PathFit fit = search_window(family, {followed.measured});
  if (fit.values.size() != family.nominal().size() || fit.inside > 0.0) return false;
  followed.solution = maximize_likelihood(family, {followed.measured}, fit);
  constexpr double small = 1e-3;  // of the interval, where no jitter is told
  if (!jitter && followed.solution.scatter() > small * interval) return false;
  of = std::max(jitter.value_or(followed.solution.scatter()), exact * interval);
  return fits(followed.solution, of, 4.0);
}

}  // namespace

void drop_outliers(const MachineFamily& family, double jitter, Mended& mended) {
  constexpr double no_say = 0.95;  // leverage of an impact that nothing else tells about
  const std::size_t most = count(mended.stretches) / most_left_out;
  for (std::size_t dropped = 0; dropped < most; ++dropped) {
    double worst = outlier;
    Impact* far = nullptr;
    double expected = 0.0;
    for (std::size_t s = 0; s < mended.stretches.size(); ++s) {
      for (std::size_t k = 0; k < mended.stretches[s].size(); ++k) {
        Impact& impact = mended.stretches[s].impacts[k];
        const double leverage = mended.solution.leverage[s][static_cast<Eigen::Index>(k)];
        if (!impact.timed || leverage > no_say) continue;
        const double of_machine = mended.solution.path[s].impacts[k].t;
        const double off = std::abs(of_machine - impact.t) / (jitter * std::sqrt(1.0 - leverage));
        if (!(off > worst)) continue;
        worst = off;
        far = &impact;
        expected = of_machine;
      }
    }
    if (far == nullptr) break;
    mended.spurious.push_back(far->event);
    far->timed = false;
    far->t = expected;
    mended.solution = maximize_likelihood(family, mended.stretches, std::move(mended.solution));
  }
  mended.missing.clear();
  for (std::size_t s = 0; s < mended.stretches.size(); ++s) {
    for (std::size_t k = 0; k < mended.stretches[s].size(); ++k) {
      if (!mended.stretches[s].impacts[k].timed) {
        mended.missing.push_back(mended.solution.path[s].impacts[k]);
      }
    }
  }
  std::sort(mended.spurious.begin(), mended.spurious.end());
}

namespace {

// Events that were taken to be spurious, where an impact is expected: the wrong one of two that
// were near each other had been taken.
void use_near_ones(const MachineFamily& family, const std::vector<Impact>& all, double jitter,
                   Mended& mended) {
  bool any = false;
  for (std::size_t k = 0; k < mended.stretches[0].size(); ++k) {
    Impact& impact = mended.stretches[0].impacts[k];
    if (impact.timed) continue;
    for (const Impact& event : all) {
      const auto of = std::find(mended.spurious.begin(), mended.spurious.end(), event.event);
      if (of == mended.spurious.end() || event.contact != impact.contact ||
          std::abs(event.t - mended.solution.path[0].impacts[k].t) > outlier * jitter) {
        continue;
      }
      mended.spurious.erase(of);
      impact = event;
      any = true;
      break;
    }
  }
  if (!any) return;
  mended.solution = maximize_likelihood(family, mended.stretches, std::move(mended.solution));
  drop_outliers(family, jitter, mended);
}

}  // namespace

Mended mend(const MachineFamily& family, const Stretches& stretches, std::optional<double> jitter,
            double interval) {
  constexpr std::size_t slide = 4;
  Mended mended;
  const Stretch& longest =
      *std::max_element(stretches.begin(), stretches.end(),
                        [](const Stretch& a, const Stretch& b) { return a.size() < b.size(); });
  const std::vector<Impact>& all = longest.impacts;
  const Projection projection(family);
  const std::size_t n = first_window(family, projection);
  Followed followed;
  double of = 0.0;
  bool found = false;
  for (std::size_t first = 0; !found && first + n <= all.size(); first += slide) {
    if (!start_at(family, all, longest.start, first, n, jitter, interval, followed, of)) continue;
    Follower follower(family, of);
    found = follower.follow(all, first + n, followed);
  }
  if (!found) return mended;
  // What was before is found with the machine as it is now known.
  const MachineFamily known(family.with(followed.solution.values), {});
  const auto few = static_cast<std::size_t>(2 * family.n() + 4);
  for (std::size_t first = 0; first + few < all.size(); ++first) {
    if (all[first].event >= followed.measured.impacts.front().event) break;
    Followed whole;
    double ignored = 0.0;
    if (!start_at(known, all, longest.start, first, few, of, interval, whole, ignored)) continue;
    Follower follower(known, 1.5 * of);
    if (!follower.follow(all, first + few, whole)) continue;
    whole.solution.values = followed.solution.values;
    whole.solution = maximize_likelihood(family, {whole.measured}, std::move(whole.solution));
    if (!fits(whole.solution, of, 4.0)) continue;
    followed = std::move(whole);
    break;
  }
  // A path that leaves out much of the record's front explains another record.
  const auto front = std::find_if(all.begin(), all.end(), [&](const Impact& impact) {
    return impact.event == followed.measured.impacts.front().event;
  });
  if (static_cast<std::size_t>(front - all.begin()) > all.size() / most_left_out) return mended;
  mended.stretches = {followed.measured};
  mended.spurious = followed.spurious;
  mended.solution = std::move(followed.solution);
  drop_outliers(family, of, mended);
  use_near_ones(family, all, of, mended);
  return mended;
}

}  // namespace sprag
