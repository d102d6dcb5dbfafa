#include "sprag/detail/identification/mending.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "sprag/detail/identification/free_flight.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/search.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr double gate = 7.0;             // in units of the usual error of a prediction
constexpr double wide_gate = 10.0;       // in gates; for slow impacts, whose predictions are worse
constexpr double outlier = 4.5;          // in standard deviations of one impact's residual
constexpr double without_jitter = 1e-9;  // of the usual interval: least jitter, for exact times
// Of the events; a path that needs more repairs is rejected.
constexpr double most_mended = 0.35;
// At most one of so many events is removed as an outlier, or lies before the path.
constexpr std::size_t most_left_out = 8;
// An interval that is longer than its neighbours by this factor probably hides a lost impact.
constexpr double long_interval = 1.5;

struct Followed {
  Stretch measured;  // with guessed times of lost impacts
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

// An impact with little restitution cannot be inverted accurately.
bool forgets_impacts(const Machine& machine) {
  constexpr double little = 0.05;
  return (machine.W.cwiseProduct(machine.jump).colwise().sum().array() < 1.0 + little).any();
}

// Continues a solution for some consecutive impacts, forward to the last event or backward to the
// first.
class Follower {
 public:
  /// A fit needs at least `least` impacts.
  Follower(const MachineFamily& family, double jitter, std::size_t least)
      : family_(&family), jitter_(jitter), least_(least) {}

  /// Forward from event number `next`, the first after those of the solution.
  bool forward(const std::vector<Impact>& all, std::size_t next, Followed& followed);

  /// Backward over the `left` events before those of the solution; there are none before `start`.
  /// If it returns false, `followed` is how far it came, with `left` events before it.
  bool backward(const std::vector<Impact>& all, std::size_t& left, double start,
                Followed& followed);

 private:
  static constexpr int between_fits = 4;
  static constexpr int most_in_a_row = 8;

  struct Expected {
    std::optional<Impact> impact;
    bool is_it = false;  // the expected impact is the event
  };

  void stand(const Followed& followed, bool at_end);
  bool refit(Followed& followed, bool at_end, double most_growth = infinity);
  void move_to(const FreeFlight& flight, double t);
  bool too_many(const std::vector<Impact>& all, const Followed& followed) const;
  // Half-width of the window for an expected impact; at most a quarter of the flight to the event
  // at `to`.
  double width(double to) const {
    constexpr double of_flight = 0.25;
    return std::min(gate * std::max(off_, 2.0 * jitter_), of_flight * std::abs(to - t_));
  }
  Expected expect(const Impact& event, bool forward) const;
  bool takes_with_doubt(const Impact& event, bool forward, Followed& followed);
  bool step(const Expected& expected, const Impact& event, bool forward, Followed& followed);
  bool can_fit(const Followed& followed) const {
    return followed.measured.size() >= least_ + static_cast<std::size_t>(followed.missing);
  }
  // An event is not doubted before a fit to all impacts so far.
  bool fit_is_due(const Expected& expected, const Followed& followed) const {
    return can_fit(followed) && (since_fit_ >= between_fits || (since_fit_ > 0 && !expected.is_it));
  }

  const MachineFamily* family_;
  double jitter_;
  std::size_t least_;
  Machine machine_;
  Eigen::VectorXd inputs_, y_, u_;
  double t_ = 0.0;
  double off_ = 0.0;  // usual error of a prediction [s]
  int since_fit_ = 0, in_a_row_ = 0;
};

// Sets the state to the end of the solution's path, after its last impact, or to just after its
// first.
void Follower::stand(const Followed& followed, bool at_end) {
  const Likelihood& solution = followed.solution;
  machine_ = family_->at(solution.values);
  inputs_ = family_->inputs(solution.values);
  since_fit_ = 0;
  if (!at_end) {
    y_ = solution.x0[0].head(family_->n());
    u_ = solution.x0[0].tail(family_->n());
    t_ = solution.path[0].start;
    move_to(FreeFlight(machine_, inputs_), solution.path[0].impacts.front().t);
    return;
  }
  Flights flights;
  Harmonics harmonics;
  flights.set(machine_, solution.path);
  harmonics.set(machine_.frequencies, solution.path);
  Path path;
  follow(machine_, flights, harmonics, solution.path[0], 0, solution.x0[0], inputs_, path);
  y_ = path.y;
  u_ = path.u;
  t_ = solution.path[0].impacts.back().t;
}

void Follower::move_to(const FreeFlight& flight, double t) {
  flight.move(t - t_, y_, u_);
  t_ = t;
}

// Fits the solution to all impacts of followed.measured. If it returns false, nothing has changed.
bool Follower::refit(Followed& followed, bool at_end, double most_growth) {
  Likelihood start = followed.solution;
  Stretch& path = start.path[0];
  const std::vector<Impact>& measured = followed.measured.impacts;
  const auto known = static_cast<std::ptrdiff_t>(path.size());
  if (at_end) {
    path.impacts.insert(path.impacts.end(), measured.begin() + known, measured.end());
  } else {
    path.impacts.insert(path.impacts.begin(), measured.begin(), measured.end() - known);
    path.start = followed.measured.start;
    start.x0[0] << y_, u_;
  }
  Likelihood next = maximize_likelihood(*family_, {followed.measured}, std::move(start));
  if (!fits(next, jitter_, 4.0)) return false;
  if (!(next.squares - followed.solution.squares <= most_growth)) return false;
  followed.solution = std::move(next);
  stand(followed, at_end);
  return true;
}

bool Follower::too_many(const std::vector<Impact>& all, const Followed& followed) const {
  return static_cast<double>(followed.spurious.size()) + followed.missing >
             most_mended * static_cast<double>(all.size()) ||
         in_a_row_ > most_in_a_row;
}

Follower::Expected Follower::expect(const Impact& event, bool forward) const {
  const double way = forward ? 1.0 : -1.0;
  const double wide = width(event.t);
  Expected expected;
  expected.impact = FreeFlight(machine_, inputs_).next_impact(y_, u_, t_, event.t + way * wide);
  expected.is_it = expected.impact && expected.impact->contact == event.contact &&
                   std::abs(expected.impact->t - event.t) <= wide;
  return expected;
}

// Whether the event is an impact although none is expected near it. At a slow impact small errors
// of the path move the time far or miss the impact. A fit with the event decides.
bool Follower::takes_with_doubt(const Impact& event, bool forward, Followed& followed) {
  if (!can_fit(followed)) return false;
  const FreeFlight flight(machine_, inputs_);
  Eigen::VectorXd y = y_, u = u_;
  flight.move(event.t - t_, y, u);
  const double speed = followed.solution.gamma[0].cwiseAbs().mean();
  if (!(std::abs(flight.gap(event.contact, y, event.t)) < wide_gate * width(event.t) * speed)) {
    return false;
  }
  Follower with_event = *this;
  Followed taken = followed;
  with_event.step({event, true}, event, forward, taken);
  if (!with_event.refit(taken, forward, square(gate * jitter_))) return false;
  *this = std::move(with_event);
  followed = std::move(taken);
  return true;
}

// Moves to the next impact, or skips a spurious event. Returns whether the event has been handled.
bool Follower::step(const Expected& expected, const Impact& event, bool forward,
                    Followed& followed) {
  const double way = forward ? 1.0 : -1.0;
  if (!expected.impact || (!expected.is_it && way * (expected.impact->t - event.t) > 0.0)) {
    // Spurious: no impact is expected, or one later than the event.
    followed.spurious.push_back(event.event);
    ++in_a_row_;
    return true;
  }
  const Impact impact = expected.is_it ? event : *expected.impact;
  const FreeFlight flight(machine_, inputs_);
  move_to(flight, impact.t);
  std::vector<Impact>& measured = followed.measured.impacts;
  if (forward) {
    flight.hit(impact.contact, impact.t, u_);
    measured.push_back(impact);
  } else {
    flight.undo_hit(impact.contact, impact.t, u_);
    measured.insert(measured.begin(), impact);
    followed.measured.start = impact.t;
  }
  ++since_fit_;
  if (expected.is_it) {
    off_ = std::sqrt(0.8 * off_ * off_ + 0.2 * square(expected.impact->t - event.t));
    in_a_row_ = 0;
  } else {
    ++followed.missing;
    ++in_a_row_;
  }
  return expected.is_it;
}

bool Follower::forward(const std::vector<Impact>& all, std::size_t next, Followed& followed) {
  stand(followed, true);
  off_ = 30.0 * jitter_;
  in_a_row_ = 0;
  while (next < all.size()) {
    if (too_many(all, followed)) return false;
    Expected expected = expect(all[next], true);
    if (fit_is_due(expected, followed)) {
      if (!refit(followed, true)) return false;
      expected = expect(all[next], true);
    }
    if ((!expected.is_it && takes_with_doubt(all[next], true, followed)) ||
        step(expected, all[next], true, followed)) {
      ++next;
    }
  }
  return !can_fit(followed) || refit(followed, true);
}

bool Follower::backward(const std::vector<Impact>& all, std::size_t& left, double start,
                        Followed& followed) {
  stand(followed, false);
  if (forgets_impacts(machine_)) return left == 0;
  off_ = 30.0 * jitter_;
  in_a_row_ = 0;
  Followed now = followed;
  now.measured.start = t_;
  std::size_t next = left;
  const auto fit = [&] {
    if (!refit(now, false)) return false;
    followed = now;
    left = next;
    return true;
  };
  while (next > 0) {
    if (too_many(all, now)) return false;
    Expected expected = expect(all[next - 1], false);
    if (fit_is_due(expected, now)) {
      if (!fit()) return false;
      expected = expect(all[next - 1], false);
    }
    if ((!expected.is_it && takes_with_doubt(all[next - 1], false, now)) ||
        step(expected, all[next - 1], false, now)) {
      --next;
    }
  }
  if (!fit()) return false;
  // Lost impacts before the first event.
  const FreeFlight flight(machine_, inputs_);
  const double wide = gate * std::max(off_, 2.0 * jitter_);
  while (t_ > start + wide) {
    const auto expected = flight.next_impact(y_, u_, t_, start + wide);
    if (!expected) break;
    if (++in_a_row_ > most_in_a_row) return true;
    move_to(flight, expected->t);
    flight.undo_hit(expected->contact, t_, u_);
    now.measured.impacts.insert(now.measured.impacts.begin(), *expected);
    ++now.missing;
  }
  move_to(flight, start);
  now.measured.start = start;
  if (refit(now, false)) followed = std::move(now);
  return true;
}

// A window of impacts to search a path for, and the part of it from which the path is followed.
struct Start {
  Stretches window;
  std::size_t base = 0;   // index of that stretch in the window
  std::size_t first = 0;  // number of that stretch's first impact in the record
};

// Windows of a record to start from, the most promising first.
class Starts {
 public:
  Starts(const MachineFamily& family, const Stretch& record) : record_(record) {
    const Projection projection(family);
    const std::size_t usual = first_window(family, projection);
    const std::size_t least = least_window(family, projection);
    cut_at_long_intervals();
    // The first hypothesis is that long intervals hide lost impacts. Shorter windows determine
    // less, so they come later.
    slide(usual, 4, false);
    join_pieces(2 * static_cast<std::size_t>(family.n()), usual, least);
    slide(least, 2, false);
    slide(usual, 4, true);
    slide(least, 2, true);
  }

  const std::vector<Start>& all() const { return starts_; }

 private:
  // Numbers the pieces between intervals that are far longer than their neighbours.
  void cut_at_long_intervals() {
    const std::vector<Impact>& impacts = record_.impacts;
    piece_of_.assign(impacts.size(), 0);
    const auto interval = [&](std::size_t k) { return impacts[k + 1].t - impacts[k].t; };
    const std::size_t intervals = impacts.empty() ? 0 : impacts.size() - 1;
    for (std::size_t k = 0; k < intervals; ++k) {
      double usual = infinity;
      if (intervals > 2) {
        // At an end of the record, extrapolate the next two intervals.
        usual = k == 0 ? std::max(interval(1), square(interval(1)) / interval(2))
                : k + 1 == intervals
                    ? std::max(interval(k - 1), square(interval(k - 1)) / interval(k - 2))
                    : std::max(interval(k - 1), interval(k + 1));
      }
      const bool cut = interval(k) > long_interval * usual;
      piece_of_[k + 1] = piece_of_[k] + (cut ? 1 : 0);
    }
  }

  Stretch part_of(std::size_t first, std::size_t size) const {
    const auto begin = record_.impacts.begin() + static_cast<std::ptrdiff_t>(first);
    return {first == 0 ? record_.start : begin->t,
            {begin, begin + static_cast<std::ptrdiff_t>(size)}};
  }

  void slide(std::size_t size, std::size_t by, bool over_long_intervals) {
    for (std::size_t first = 0; first + size <= record_.size(); first += by) {
      const bool over = piece_of_[first] != piece_of_[first + size - 1];
      if (over == over_long_intervals) starts_.push_back({{part_of(first, size)}, 0, first});
    }
  }

  // Several pieces together determine the machine if each has more impacts than its start has
  // unknowns.
  void join_pieces(std::size_t of_start, std::size_t usual, std::size_t least) {
    constexpr std::size_t most = 4;
    std::vector<std::size_t> firsts;
    std::vector<Stretch> pieces;
    for (std::size_t first = 0, last = 0; first < record_.size(); first = last) {
      while (last < record_.size() && piece_of_[last] == piece_of_[first]) ++last;
      if (last - first < of_start + 2) continue;
      firsts.push_back(first);
      pieces.push_back(part_of(first, std::min(last - first, usual)));
    }
    for (std::size_t i = 0; i + 1 < pieces.size(); ++i) {
      Start start;
      std::size_t covered = of_start;
      for (std::size_t j = i; j < std::min(i + most, pieces.size()) && covered < usual; ++j) {
        start.window.push_back(pieces[j]);
        covered += pieces[j].size() - of_start;
        if (pieces[j].size() > start.window[start.base].size()) start.base = j - i;
      }
      start.first = firsts[i + start.base];
      if (start.window.size() > 1 && covered >= least) starts_.push_back(std::move(start));
    }
  }

  const Stretch& record_;
  std::vector<int> piece_of_;  // piece of each impact
  std::vector<Start> starts_;
};

bool solve(const MachineFamily& family, const Start& start, std::optional<double> jitter,
           double interval, Followed& followed, double& of) {
  const PathFit fit = search_window(family, start.window);
  if (fit.values.size() != family.nominal().size() || fit.inside > 0.0) return false;
  Likelihood solution = maximize_likelihood(family, start.window, fit);
  constexpr double small = 5e-3;  // of the interval, if no jitter is specified
  if (!jitter && solution.scatter() > small * interval) return false;
  // The scatter of few times is uncertain.
  const double of_few = 1.0 + 2.0 / std::sqrt(std::max(solution.freedom, 1));
  of = std::max(jitter.value_or(of_few * solution.scatter()), without_jitter * interval);
  if (!fits(solution, of, 4.0)) return false;
  followed = {};
  followed.measured = start.window[start.base];
  solution.x0 = {solution.x0[start.base]};
  solution.path = {solution.path[start.base]};
  solution.gamma = {solution.gamma[start.base]};
  followed.solution = std::move(solution);
  return true;
}

}  // namespace

void drop_outliers(const MachineFamily& family, double jitter, Mended& mended) {
  constexpr double no_say = 0.95;  // leverage above which no other event checks the impact's time
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

// Uses spurious events close to an expected impact: of two events near each other the wrong one had
// been used.
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

bool mend(const MachineFamily& family, const Stretch& record, std::optional<double> jitter,
          double interval, const std::function<bool(const Mended&)>& is_solution) {
  constexpr int most_refused = 8;
  const std::vector<Impact>& all = record.impacts;
  const std::size_t least = least_window(family, Projection(family));
  const Starts starts(family, record);
  int refused = 0;
  for (const Start& start : starts.all()) {
    Followed followed;
    double of = 0.0;
    if (!solve(family, start, jitter, interval, followed, of)) continue;
    Follower follower(family, of, least);
    if (!follower.forward(all, start.first + followed.measured.size(), followed)) continue;
    std::size_t left = start.first;
    // A path that excludes much of the record's beginning is rejected.
    if (!follower.backward(all, left, record.start, followed) &&
        left > all.size() / most_left_out) {
      continue;
    }
    Mended mended;
    mended.stretches = {followed.measured};
    mended.spurious = followed.spurious;
    mended.solution = std::move(followed.solution);
    drop_outliers(family, of, mended);
    use_near_ones(family, all, of, mended);
    if (is_solution(mended)) return true;
    if (++refused == most_refused) return false;
  }
  return false;
}

}  // namespace sprag
