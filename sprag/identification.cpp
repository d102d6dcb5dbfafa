#include "sprag/identification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "sprag/detail/identification/bounces.h"
#include "sprag/detail/identification/departure.h"
#include "sprag/detail/identification/determination.h"
#include "sprag/detail/identification/fitted_scene.h"
#include "sprag/detail/identification/free_flight.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/maximum_likelihood.h"
#include "sprag/detail/identification/mending.h"
#include "sprag/detail/identification/projection.h"
#include "sprag/detail/identification/record.h"
#include "sprag/detail/identification/record_checks.h"
#include "sprag/detail/identification/record_errors.h"
#include "sprag/detail/identification/search.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/clock_ambiguity.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/detail/parameters/unknowns.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// Shares of the typical time between impacts.
constexpr double exact = 2e-9;          // residual of a fit to exact times
constexpr double nearly_exact = 1e-5;   // residual along a valley of solutions
constexpr double least_jitter = 1e-10;  // times cannot be distinguished
constexpr double unreported =
    0.05;  // uncertainty of a stretch's path beyond which its events do not determine it
constexpr double promising = 2e-3;  // a search ends below this residual if the jitter is not given
constexpr double largest_jitter = 0.02;  // a larger scatter is not jitter
// Impacts closer together are merged; the larger value is tried if the smaller gives no fit.
constexpr double close = 3e-4, less_close = 0.0065;
constexpr double close_in_jitters = 6.0;
constexpr double search_in_jitters = 30.0;
constexpr double deviations = 1.96;  // half of a 95 % interval
constexpr double better_by = 0.5;    // share of the scatter that another minimum must reach
// A flight that nearly touches a support may seem to cross it where its state is most uncertain.
constexpr double passage_in_jitters = 50.0;

double largest_chi2(int freedom) {
  const double of = std::max(freedom, 1);
  return of * (1.0 + 6.0 * std::sqrt(2.0 / of));
}

// Robust standard deviation: 1.4826 times the median, insensitive to outliers.
double usual(std::vector<double> sizes) {
  if (sizes.empty()) return 0.0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return 1.4826 * *middle;
}

enum class Judged { good, none, unconverged, scatter, inside };

struct OtherMinimum {
  Eigen::VectorXd values;
  double scatter = 0.0;
};

struct Attempt {
  Stretches stretches;  // data of the fit
  Likelihood solution;
  std::vector<OtherMinimum> others;  // that are good as well
  double jitter = 0.0;               // specified, or found
  Judged judged = Judged::none;
  int bounces = 0;  // passed bounces, and those that became impacts
  std::vector<std::size_t> spurious;
  std::vector<MissingImpact> missing;
  std::vector<std::size_t> held;  // unknowns that are held at their nominal values

  bool good() const { return judged == Judged::good; }
  bool exists() const { return judged != Judged::none; }
};

int bounces_of(const Stretches& stretches) {
  int bounces = 0;
  for (const Stretch& stretch : stretches) {
    for (const Impact& impact : stretch.impacts) {
      bounces += static_cast<int>(
          std::count_if(impact.passed.begin(), impact.passed.end(),
                        [](const Passage& passage) { return passage.contact >= 0; }));
    }
  }
  return bounces;
}

// Whether the machine moves freely from the start of a stretch to t, before its first impact.
bool is_free_until(const Stretch& stretch, double t) {
  const Impact& first = stretch.impacts.front();
  return stretch.closed == 0 && stretch.held == 0 && first.passed.empty() && t < first.t;
}

// Derivative of the free part of the motion after tau by that before, 2n x 2n.
Eigen::MatrixXd transition(const FreeFlight& flight, double tau, Eigen::Index n) {
  const auto moved = [&](const Eigen::VectorXd& x) {
    Eigen::VectorXd y = x.head(n), u = x.tail(n), end(2 * n);
    flight.move(tau, y, u);
    end << y, u;
    return end;
  };
  const Eigen::VectorXd origin = moved(Eigen::VectorXd::Zero(2 * n));
  Eigen::MatrixXd matrix(2 * n, 2 * n);
  for (Eigen::Index j = 0; j < 2 * n; ++j) {
    matrix.col(j) = moved(Eigen::VectorXd::Unit(2 * n, j)) - origin;
  }
  return matrix;
}

class Identifier {
 public:
  Identifier(const Scene& scene, std::span<const ContactEvent> events,
             const IdentificationSettings& settings)
      : events_(events), settings_(settings), family_(scene, settings.unknowns) {}

  Identification run();

 private:
  RecordSettings known_record() const {
    return {.begins = settings_.begins, .closed = settings_.closed, .gaps = settings_.gaps};
  }
  Stretches stretches_of(double closest, bool through_contact, std::optional<double> jitter) const;
  std::size_t needed(const Stretches& stretches) const;
  Likelihood maximize(const PathFit& found, Stretches& stretches) const;
  Judged judge(const MachineFamily& family, const Likelihood& solution, double& jitter) const;
  bool comes_from_outside(const MachineFamily& family, const Likelihood& solution,
                          double jitter) const;

  void consider(Attempt next, Attempt& best) const;
  std::vector<Eigen::VectorXd> rivals(const Attempt& best) const;
  Attempt attempt(const Stretches& stretches) const;
  void from_values(const MachineFamily& fewer, const Likelihood& of_fewer,
                   const Stretches& stretches, Attempt& best) const;
  void from_nominal(const Stretches& stretches, Attempt& best) const;
  void from_narrower(const Stretches& stretches, Attempt& best) const;
  void from_fewer(const Stretches& stretches, Attempt& best) const;
  void cut_by_the_jitter(Attempt& best) const;
  void through_bounces(Attempt& best) const;
  void mends(Stretches stretches, std::optional<double> jitter, Attempt& best) const;

  void predict(const Attempt& best, const std::vector<std::size_t>& held,
               Identification& result) const;
  void describe(const Attempt& best, const Determination& determination,
                Identification& result) const;
  void put_start(const Likelihood& solution, double sigma, Identification& result) const;
  void put_combinations(const Attempt& best, Identification& result) const;
  void put_inside(const Attempt& best, Identification& result) const;
  bool is_unpredictable(const Attempt& best, const Identification& result) const;
  bool is_structured(const Identification& result) const;
  bool has_lost_its_scale(const Attempt& best) const;
  void conclude(Attempt& best, Identification& result);
  void include_record_errors(const Attempt& best, std::span<const std::size_t> held,
                             Identification& result) const;
  void put_verdict(const Attempt& best, Identification& result) const;

  double good() const {
    const double good = settings_.jitter
                            ? std::max(search_in_jitters * *settings_.jitter, exact * interval_)
                            : promising * interval_;
    return std::min(good, good_limit_);
  }

  std::span<const ContactEvent> events_;
  const IdentificationSettings& settings_;
  MachineFamily family_;
  double interval_ = 0.0;
  double good_limit_ = infinity;
  Determination determination_;  // of the best attempt
};

Stretches Identifier::stretches_of(double closest, bool through_contact,
                                   std::optional<double> jitter) const {
  RecordSettings record = known_record();
  if (through_contact) {
    record.can_follow = [nominal = family_.at(family_.nominal())](int contact, ContactSet held,
                                                                  ContactSet staying) {
      // Motions with held contacts have no response to a record.
      if (nominal.records() > 0 && (held | staying) != 0) return false;
      return is_one_impact(nominal, contact, held, staying);
    };
  }
  record.exact = settings_.jitter == 0.0;
  record.close = std::max(closest * interval_, close_in_jitters * jitter.value_or(0.0));
  Stretches stretches = cut(events_, record, 2 * static_cast<std::size_t>(family_.n()) + 2);
  const std::vector<std::size_t>& guessed = settings_.guessed;
  for (Stretch& stretch : stretches) {
    for (Impact& impact : stretch.impacts) {
      impact.timed = std::find(guessed.begin(), guessed.end(), impact.event) == guessed.end();
    }
  }
  return stretches;
}

bool Identifier::comes_from_outside(const MachineFamily& family, const Likelihood& solution,
                                    double jitter) const {
  const double allowed = passage_in_jitters * jitter + 1e3 * exact * interval_;
  const std::vector<StretchPath> checks = check_paths(family, solution, jitter);
  return std::none_of(checks.begin(), checks.end(), [&](const StretchPath& check) {
    return check.hit_from_inside || !(check.inside < allowed);
  });
}

Judged Identifier::judge(const MachineFamily& family, const Likelihood& solution,
                         double& jitter) const {
  if (!solution.values.allFinite() || !std::isfinite(solution.squares)) return Judged::none;
  jitter = std::max(settings_.jitter.value_or(solution.scatter()), least_jitter * interval_);
  if (!settings_.jitter && jitter > largest_jitter * interval_) return Judged::scatter;
  if (settings_.jitter && !(solution.squares / square(jitter) < largest_chi2(solution.freedom))) {
    return Judged::scatter;
  }
  if (!solution.converged &&
      !(solution.violation < exact * interval_ && solution.scatter() < exact * interval_)) {
    return Judged::unconverged;
  }
  return comes_from_outside(family, solution, jitter) ? Judged::good : Judged::inside;
}

std::size_t Identifier::needed(const Stretches& of) const {
  const std::size_t unknowns = family_.unknowns().size();
  // An estimated jitter is an unknown, too: it needs more equations than unknowns.
  const std::size_t of_jitter = settings_.jitter ? 0 : unknowns;
  return unknowns + of_jitter + 2 * static_cast<std::size_t>(family_.n()) * of.size() + 2;
}

// If the stretches do not fit, tries again without those whose times do not determine their own
// path, such as the bounces of a single chatter. They determine hardly more than their own start.
Likelihood Identifier::maximize(const PathFit& found, Stretches& stretches) const {
  Likelihood solution = maximize_likelihood(family_, stretches, found);
  if (stretches.size() < 2 || !solution.values.allFinite()) return solution;
  double jitter = 0.0;
  if (judge(family_, solution, jitter) == Judged::good) return solution;
  const std::vector<StretchPath> checks = check_paths(family_, solution, jitter);
  Stretches kept;
  Likelihood start;
  start.values = solution.values;
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    if (!(checks[s].unknown < unreported * interval_)) continue;
    kept.push_back(stretches[s]);
    start.path.push_back(solution.path[s]);
    start.x0.push_back(solution.x0[s]);
  }
  if (kept.size() == stretches.size() || equations(kept) < needed(kept)) return solution;
  Likelihood without = maximize_likelihood(family_, kept, std::move(start));
  if (judge(family_, without, jitter) != Judged::good) return solution;
  stretches = std::move(kept);
  return without;
}

// Replaces the best attempt by a better one. Solutions at other values are kept in `others`.
void Identifier::consider(Attempt next, Attempt& best) const {
  constexpr double same = 1e-6;  // in coordinates
  const auto differ = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    for (std::size_t k = 0; k < family_.unknowns().size(); ++k) {
      const Unknown& unknown = family_.unknowns()[k];
      const auto i = static_cast<Eigen::Index>(k);
      double off = unknown.coordinate(a[i]) - unknown.coordinate(b[i]);
      if (unknown.kind == Kind::phase) off = std::remainder(off, 2.0 * std::numbers::pi);
      if (std::abs(off) > same) return true;
    }
    return false;
  };
  const bool better = next.solution.scatter() < best.solution.scatter();
  if (best.good() && next.good()) {
    Attempt& other = better ? best : next;
    if (differ(best.solution.values, next.solution.values)) {
      next.others = best.others;
      next.others.push_back({other.solution.values, other.solution.scatter()});
      best.others = next.others;
    } else {
      next.others = best.others;
    }
    if (better) best = std::move(next);
  } else if (next.good() || (!best.good() && (!best.exists() || better))) {
    best = std::move(next);
  }
}

// Values at the other minima that the events do not exclude. Without a specified jitter, a far
// larger scatter excludes a minimum.
std::vector<Eigen::VectorXd> Identifier::rivals(const Attempt& best) const {
  constexpr double far_larger = 10.0;
  std::vector<Eigen::VectorXd> values;
  for (const OtherMinimum& other : best.others) {
    if (settings_.jitter || other.scatter < far_larger * best.solution.scatter()) {
      values.push_back(other.values);
    }
  }
  return values;
}

Attempt Identifier::attempt(const Stretches& stretches) const {
  Attempt best;
  best.stretches = stretches;
  const auto attempt_at = [&](const PathFit& found) {
    Attempt next;
    next.stretches = stretches;
    next.solution = maximize(found, next.stretches);
    next.judged = judge(family_, next.solution, next.jitter);
    return next;
  };
  const auto is_solution = [&](const PathFit& found) {
    Attempt next = attempt_at(found);
    const bool good = next.good();
    consider(std::move(next), best);
    return good;
  };
  const PathFit found = search(family_, stretches, {good(), is_solution});
  if (!best.exists() && found.values.size() == family_.nominal().size()) {
    best = attempt_at(found);
  }
  return best;
}

// Starts from a solution with fewer unknowns, the others at their nominal values.
void Identifier::from_values(const MachineFamily& fewer, const Likelihood& of_fewer,
                             const Stretches& stretches, Attempt& best) const {
  Likelihood start = of_fewer;
  start.values = family_.nominal();
  std::vector<std::size_t> held;
  for (std::size_t k = 0; k < family_.unknowns().size(); ++k) {
    const std::vector<Unknown>& of = fewer.unknowns();
    const auto same = std::find_if(of.begin(), of.end(), [&](const Unknown& unknown) {
      return unknown.key == family_.unknowns()[k].key;
    });
    if (same == of.end()) {
      held.push_back(k);
    } else {
      start.values[static_cast<Eigen::Index>(k)] = of_fewer.values[same - of.begin()];
    }
  }
  // Frees all unknowns; those that the events determine; those of the solution.
  const double sigma = std::max(settings_.jitter.value_or(0.0), of_fewer.scatter());
  std::vector<std::size_t> weak = undetermined_at(family_, stretches, start, sigma);
  for (const std::vector<std::size_t>& of : {std::vector<std::size_t>{}, weak, held}) {
    Attempt next;
    next.stretches = stretches;
    next.held = of;
    next.solution = maximize_likelihood(family_, stretches, start, of);
    next.judged = judge(family_, next.solution, next.jitter);
    const bool good = next.good();
    consider(std::move(next), best);
    if (good) return;
  }
}

// Starts from the nominal machine, with only the start fitted.
void Identifier::from_nominal(const Stretches& stretches, Attempt& best) const {
  if (family_.unknowns().empty()) return;
  const MachineFamily fixed(family_.scene(), {});
  Projection projection(fixed);
  projection.take(stretches);
  const Likelihood alone = maximize_likelihood(fixed, stretches, projection.at(Eigen::VectorXd(0)));
  double jitter = 0.0;
  if (judge(fixed, alone, jitter) == Judged::good) from_values(fixed, alone, stretches, best);
}

// The wider the ranges, the coarser the grid of the search: what is found in narrower ranges
// counts.
void Identifier::from_narrower(const Stretches& stretches, Attempt& best) const {
  for (const double share : {0.2, 0.35, 0.5, 0.7}) {
    if (best.good()) return;
    IdentificationSettings settings = settings_;
    bool narrower = false;
    for (Unknown& unknown : settings.unknowns) {
      narrower = narrower || unknown.within > share;
      unknown.within = std::min(unknown.within, share);
    }
    if (!narrower) return;
    Identifier within(family_.scene(), events_, settings);
    within.interval_ = interval_;
    const Attempt found = within.attempt(stretches);
    if (found.good()) from_values(within.family_, found.solution, found.stretches, best);
  }
}

// One or two unknowns are easier to find than all.
void Identifier::from_fewer(const Stretches& stretches, Attempt& best) const {
  const std::vector<Unknown>& all = family_.unknowns();
  if (best.good() || !settings_.jitter || all.size() < 3) return;
  const auto solves = [&](std::vector<Unknown> some) {
    IdentificationSettings settings = settings_;
    settings.unknowns = std::move(some);
    Identifier fewer(family_.scene(), events_, settings);
    fewer.interval_ = interval_;
    const Attempt of_fewer = fewer.attempt(stretches);
    if (!of_fewer.good()) return false;
    from_values(fewer.family_, of_fewer.solution, of_fewer.stretches, best);
    return best.good();
  };
  for (const Unknown& one : all) {
    if (solves({one})) return;
  }
  for (std::size_t j = 0; j < all.size(); ++j) {
    for (std::size_t k = j + 1; k < all.size(); ++k) {
      if (solves({all[j], all[k]})) return;
    }
  }
}

// Merges impacts that are too close for the estimated jitter, and fits again.
void Identifier::cut_by_the_jitter(Attempt& best) const {
  if (settings_.jitter || !best.good()) return;
  Attempt again;
  again.stretches = stretches_of(close, settings_.through_contact, best.jitter);
  if (count(again.stretches) == count(best.stretches) ||
      equations(again.stretches) < needed(again.stretches)) {
    return;
  }
  Projection projection(family_);
  projection.take(again.stretches);
  again.solution = maximize(projection.at(best.solution.values), again.stretches);
  again.judged = judge(family_, again.solution, again.jitter);
  again.others = best.others;
  if (again.good()) best = std::move(again);
}

// With exact times the passed bounces are impacts as well. They are located along the solution, or
// along the measured times if that fails.
void Identifier::through_bounces(Attempt& best) const {
  best.bounces = bounces_of(best.stretches);
  if (best.bounces == 0 || !(best.solution.scatter() > exact * interval_) ||
      !(best.solution.scatter() < largest_jitter * interval_)) {
    return;
  }
  for (const bool of_solution : {true, false}) {
    Attempt with = best;
    if (!of_solution) {
      Projection projection(family_);
      projection.take(with.stretches);
      with.solution =
          along_measured_times(family_, with.stretches, projection.at(best.solution.values));
    }
    take_bounces(family_, best.jitter, with.stretches, with.solution);
    with.solution = maximize_likelihood(family_, with.stretches, std::move(with.solution));
    with.judged = judge(family_, with.solution, with.jitter);
    if (!with.good()) continue;
    best = std::move(with);
    return;
  }
}

// A spurious event next to a missing one of the same contact is a moved event, which is not a
// repair.
bool moves_an_event(const std::vector<std::size_t>& spurious,
                    const std::vector<MissingImpact>& missing, std::span<const ContactEvent> events,
                    double interval) {
  constexpr double beside = 0.25;
  return std::any_of(spurious.begin(), spurious.end(), [&](std::size_t i) {
    return std::any_of(missing.begin(), missing.end(), [&](const MissingImpact& impact) {
      return impact.contact == events[i].contact &&
             std::abs(impact.t - events[i].t) < beside * interval;
    });
  });
}

// Repairs the longest stretch, then adds the other stretches, unchanged or repaired, while all fit
// together.
void Identifier::mends(Stretches stretches, std::optional<double> jitter, Attempt& best) const {
  std::stable_sort(stretches.begin(), stretches.end(),
                   [](const Stretch& a, const Stretch& b) { return a.size() > b.size(); });
  std::optional<Attempt> repaired;
  constexpr double far_less = 0.1;
  const double unrepaired = best.exists() ? best.solution.scatter() : infinity;
  // Whether a stretch, repaired or unchanged, fits together with those added before.
  const auto add = [&](const Mended& mended) {
    Attempt next;
    if (repaired) next = *repaired;
    next.spurious.insert(next.spurious.end(), mended.spurious.begin(), mended.spurious.end());
    for (const Impact& impact : mended.missing) next.missing.push_back({impact.t, impact.contact});
    if (moves_an_event(next.spurious, next.missing, events_, interval_)) return false;
    Likelihood start = mended.solution;
    if (repaired) {
      // Keeps the order of time.
      const double t = mended.stretches.front().start;
      const auto later = std::find_if(next.stretches.begin(), next.stretches.end(),
                                      [&](const Stretch& stretch) { return stretch.start > t; });
      const auto at = later - next.stretches.begin();
      start = next.solution;
      start.path.insert(start.path.begin() + at, mended.solution.path.front());
      start.x0.insert(start.x0.begin() + at, mended.solution.x0.front());
      next.stretches.insert(later, mended.stretches.front());
    } else {
      next.stretches = mended.stretches;
    }
    next.solution = maximize_likelihood(family_, next.stretches, std::move(start));
    next.judged = judge(family_, next.solution, next.jitter);
    const bool far_better = next.judged == Judged::scatter && next.solution.converged &&
                            next.solution.scatter() < far_less * unrepaired;
    if (!next.good() && !far_better) return false;
    repaired = std::move(next);
    return true;
  };
  for (const Stretch& stretch : stretches) {
    if (repaired) {
      Mended as_it_is;
      as_it_is.stretches = {stretch};
      const MachineFamily known(family_.as_timed(repaired->solution.values), {});
      Projection projection(known);
      projection.take(as_it_is.stretches);
      as_it_is.solution =
          maximize_likelihood(known, as_it_is.stretches, projection.at(Eigen::VectorXd(0)));
      double of = 0.0;
      const bool fits = judge(known, as_it_is.solution, of) == Judged::good;
      if (fits && add(as_it_is)) continue;
    }
    mend(family_, stretch, jitter, interval_, add);
  }
  if (repaired && !(repaired->spurious.empty() && repaired->missing.empty())) {
    best = std::move(*repaired);
  }
}

// Fits the first four fifths and compares its predictions with the last fifth.
void Identifier::predict(const Attempt& best, const std::vector<std::size_t>& held,
                         Identification& result) const {
  const Stretches& stretches = best.stretches;
  const std::size_t total = count(stretches);
  const std::size_t first = total - total / 5;
  Stretches before = part(stretches, 0, first);
  Likelihood start = best.solution;
  start.path = part(best.solution.path, 0, first);
  const std::size_t fewest = static_cast<std::size_t>(2 * family_.n()) + 1;
  while (!before.empty() && before.back().equations() < fewest) {
    before.pop_back();
    start.path.pop_back();
  }
  if (before.empty()) return;
  start.x0.resize(before.size());
  const Likelihood fit = maximize_likelihood(family_, before, std::move(start), held);
  if (!fit.values.allFinite()) return;
  result.first_squares = fit.squares;
  result.first_freedom = fit.freedom;
  // A path along the measured times follows the machine, so that its gap at each impact is a
  // prediction from the impacts before.
  const Machine machine = family_.at(fit.values);
  const Eigen::VectorXd inputs = family_.inputs(fit.values);
  Flights flights;
  Harmonics harmonics;
  const Stretches compared(stretches.begin(),
                           stretches.begin() + static_cast<std::ptrdiff_t>(before.size()));
  flights.set(machine, compared);
  harmonics.set(machine.frequencies, compared);
  std::vector<double> inside, beyond;
  std::size_t number = 0;
  for (std::size_t s = 0; s < compared.size(); ++s) {
    Path path;
    follow(machine, flights, harmonics, compared[s], s, fit.x0[s], inputs, path);
    const auto add = [&](std::size_t from, std::size_t to, std::vector<double>& off) {
      const auto at = static_cast<Eigen::Index>(from);
      const Eigen::VectorXd speed =
          path.gamma.segment(at, static_cast<Eigen::Index>(to - from)).cwiseAbs();
      for (std::size_t k = from; k < to; ++k) {
        if (!compared[s].impacts[k].timed) continue;
        const auto i = static_cast<Eigen::Index>(k);
        // The time of a grazing impact is uncertain, so that its speed is limited from below.
        off.push_back(std::abs(path.g[i]) / std::max(speed[i - at], speed.mean() / 3.0));
      }
    };
    const std::size_t split = first - std::min(first, number);
    const std::size_t size = compared[s].size();
    add(0, std::min(split, size), inside);
    add(std::min(split, size), size, beyond);
    number += size;
  }
  result.predicted_before = usual(inside);
  result.predicted = usual(beyond);
}

// `sigma`: standard deviation of event times.
void Identifier::put_start(const Likelihood& solution, double sigma, Identification& result) const {
  const Machine machine = family_.at(solution.values);
  const Eigen::VectorXd inputs = family_.inputs(solution.values);
  const Eigen::Index n = family_.n();
  const double scale = family_.clock_scale(solution.values);
  const double shift = family_.clock_shift(solution.values);
  double t = solution.path.front().start;
  Eigen::VectorXd y = solution.x0.front().head(n), u = solution.x0.front().tail(n);
  Eigen::MatrixXd covariance = solution.x0_covariance.front();
  if (shift != 0.0 && t == 0.0 && is_free_until(solution.path.front(), shift)) {
    // The machine's t = 0 is at `shift`.
    const FreeFlight flight(machine, inputs);
    const Eigen::MatrixXd turn = transition(flight, shift, n);
    flight.move(shift, y, u);
    covariance = congruent(turn.transpose(), covariance);
    t = shift;
  }
  add_driven_motion(machine, inputs, t, y, u);
  const Eigen::MatrixXd& V = family_.V();
  result.start_t = (t - shift) / scale;
  result.begins = settings_.begins == 0.0 ? 0.0 : (settings_.begins - shift) / scale;
  u *= scale;
  result.start = {V * y, V * u};
  const Eigen::MatrixXd of_q = congruent(V.transpose(), covariance.topLeftCorner(n, n));
  const Eigen::MatrixXd of_u = congruent(V.transpose(), covariance.bottomRightCorner(n, n));
  result.start_sigma = {sigma * of_q.diagonal().cwiseMax(0.0).cwiseSqrt(),
                        scale * sigma * of_u.diagonal().cwiseMax(0.0).cwiseSqrt()};
}

// Interval in which the machine would be inside a support.
void Identifier::put_inside(const Attempt& best, Identification& result) const {
  double worst = -1.0;
  const std::vector<StretchPath> checks = check_paths(family_, best.solution, best.jitter);
  for (const StretchPath& check : checks) {
    const double inside = check.hit_from_inside || check.inside > 0.0 ? check.inside : -1.0;
    if (!(inside > worst)) continue;
    worst = inside;
    result.inside_from = check.inside_from;
    result.inside_to = check.inside_to;
  }
}

void Identifier::describe(const Attempt& best, const Determination& determination,
                          Identification& result) const {
  const Stretches& stretches = best.stretches;
  const Likelihood& solution = best.solution;
  result.jitter = best.jitter;
  result.jitter_given = settings_.jitter.has_value();
  result.scatter = solution.scatter();
  result.freedom = solution.freedom;
  result.chi2 = solution.squares / square(best.jitter);
  result.largest_chi2 = largest_chi2(solution.freedom);
  result.impacts = solution.timed;
  result.stretches = static_cast<int>(stretches.size());
  result.from = stretches.front().impacts.front().t;
  result.to = stretches.back().impacts.back().t;
  result.others = rivals(best);
  result.spurious = best.spurious;
  result.missing = best.missing;
  result.spurious_left_out = static_cast<int>(best.spurious.size());
  result.events =
      distinct_closings(events_, std::max(close * interval_, close_in_jitters * best.jitter));
  result.left_out = std::max(0, result.events - result.impacts - best.bounces);
  const double sigma = std::max(best.jitter, solution.scatter());
  const auto unknowns = static_cast<Eigen::Index>(family_.unknowns().size());
  for (Eigen::Index k = 0; k < unknowns; ++k) {
    const auto number = static_cast<std::size_t>(k);
    FittedUnknown fitted{.unknown = family_.unknowns()[number]};
    const Unknown& unknown = fitted.unknown;
    fitted.value = solution.values[k];
    if (unknown.kind == Kind::phase) {
      fitted.value =
          unknown.nominal + std::remainder(fitted.value - unknown.nominal, 2.0 * std::numbers::pi);
    }
    if (number < determination.unknowns.size()) {
      const Determined& of = determination.unknowns[number];
      fitted.determined = of.determined;
      fitted.sigma = of.sigma * std::abs(unknown.slope(fitted.value));
      fitted.at_bound = of.at_physical_bound;
      const double at = unknown.coordinate(fitted.value);
      fitted.low = unknown.value(at - of.down);
      fitted.high = unknown.value(at + of.up);
    } else {
      fitted.determined = false;
    }
    const double variance = solution.covariance(k, k);
    for (Eigen::Index j = 0; j < unknowns; ++j) {
      const auto other = static_cast<std::size_t>(j);
      const double scale = std::sqrt(variance * solution.covariance(j, j));
      const bool known =
          other < determination.unknowns.size() && determination.unknowns[other].determined;
      if (j == k || !(scale > 0.0) || !known) continue;
      const double correlation = solution.covariance(k, j) / scale;
      if (fitted.partner < 0 || std::abs(correlation) > std::abs(fitted.correlation)) {
        fitted.partner = static_cast<int>(j);
        fitted.correlation = correlation;
      }
    }
    result.unknowns.push_back(std::move(fitted));
  }
  put_start(solution, sigma, result);
  result.likelihood = solution;
  result.measured = stretches;
  Eigen::VectorXd values = solution.values;
  for (Eigen::Index k = 0; k < unknowns; ++k) {
    values[k] = result.unknowns[static_cast<std::size_t>(k)].value;
  }
  result.fitted = with(family_.scene(), family_.unknowns(), values);
  result.fitted.prior.start = result.start;
  result.fitted.prior.jitter = result.jitter;
}

// Principal directions in the space of the undetermined unknowns that the events do determine.
void Identifier::put_combinations(const Attempt& best, Identification& result) const {
  constexpr double known = 0.05, least_weight = 0.1;
  std::vector<Eigen::Index> open;
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    if (!result.unknowns[k].determined) open.push_back(static_cast<Eigen::Index>(k));
  }
  if (open.size() < 2) return;
  const double sigma = std::max(best.jitter, best.solution.scatter());
  const auto n = static_cast<Eigen::Index>(open.size());
  const Eigen::MatrixXd covariance = square(sigma) * best.solution.covariance(open, open);
  const Eigenpairs pairs = eigenpairs(covariance, Eigen::MatrixXd::Identity(n, n));
  for (Eigen::Index j = 0; j < n; ++j) {
    const double variance = pairs.values[j];
    if (!(variance > 0.0) || !(variance < square(known))) continue;
    Combination combination{.weights = {}, .sigma = std::sqrt(variance)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const double weight = pairs.vectors(i, j) / pairs.vectors.col(j).norm();
      if (std::abs(weight) < least_weight) continue;
      combination.weights.emplace_back(static_cast<std::size_t>(open[static_cast<std::size_t>(i)]),
                                       weight);
    }
    result.combinations.push_back(std::move(combination));
  }
  // All directions are determined: the other solution is separate.
  if (std::ssize(result.combinations) == n) result.combinations.clear();
}

// If the model is right, the squares that the last fifth adds, over the jitter^2 of the rest, are
// chi^2 distributed with the added degrees of freedom.
bool Identifier::is_unpredictable(const Attempt& best, const Identification& result) const {
  const int added = result.freedom - result.first_freedom;
  if (!(result.first_freedom > 0) || added <= 0) return false;
  // A jitter estimated from few impacts is uncertain.
  const double of_few = settings_.jitter ? 1.0 : 1.0 + 3.0 * std::sqrt(2.0 / result.first_freedom);
  if (result.departure.is_scatter()) {
    return result.departure.scatter->growth * added > of_few * largest_chi2(added);
  }
  const double jitter = settings_.jitter.value_or(0.0) > 0.0
                            ? *settings_.jitter
                            : std::sqrt(result.first_squares / result.first_freedom);
  const double squares = best.solution.squares - result.first_squares;
  return squares > of_few * (square(jitter) + square(exact * interval_)) * largest_chi2(added);
}

// Whether another cause of scatter is likelier than jitter. A restitution that scatters from impact
// to impact is not a wrong model.
bool Identifier::is_structured(const Identification& result) const {
  return settings_.white && !settings_.jitter && result.departure.is_structured();
}

// Whether the motion is so large that the inputs, which set its scale, do not matter.
bool Identifier::has_lost_its_scale(const Attempt& best) const {
  constexpr double far_larger = 1e6;
  const Machine machine = family_.at(best.solution.values);
  const Eigen::VectorXd inputs = family_.inputs(best.solution.values);
  double set = 0.0;  // largest gap that the inputs cause
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    set = std::max(
        set, machine.gap_response.col(g).cwiseAbs().maxCoeff() * inputs.segment(2 * g, 2).norm());
  }
  for (const Stretch& stretch : best.solution.path) {
    for (const Impact& impact : stretch.impacts) {
      for (Eigen::Index r = 0; r < machine.records(); ++r) {
        const double g = recorded_gap(machine, impact.contact, r, impact.t).g;
        set = std::max(set, std::abs(g * inputs[2 * machine.groups() + r]));
      }
    }
  }
  for (Eigen::Index j = 0; j < machine.constant_forces.cols(); ++j) {
    const Eigen::VectorXd push = machine.constant_forces.col(j) * inputs[machine.driving() + j];
    set = std::max(set, (machine.W.transpose() * push).cwiseAbs().maxCoeff() * square(interval_));
  }
  set = std::max(set, inputs.tail(machine.W.cols()).cwiseAbs().maxCoeff());
  double speed = 0.0;
  for (const Eigen::VectorXd& gamma : best.solution.gamma) {
    speed = std::max(speed, gamma.cwiseAbs().maxCoeff());
  }
  return set > 0.0 && speed * interval_ > far_larger * set;
}

void Identifier::put_verdict(const Attempt& best, Identification& result) const {
  const Determination& determination = determination_;
  constexpr double least_used = 0.9;      // of the events
  constexpr double largest_start = 30.0;  // relative to the motions on the path
  constexpr double tolerance = 3.0;       // in standard deviations beyond the range
  const auto end_of_range = [&]() -> int {
    for (std::size_t k = 0; k < family_.unknowns().size(); ++k) {
      const Unknown& unknown = family_.unknowns()[k];
      const double value = best.solution.values[static_cast<Eigen::Index>(k)];
      const bool at_end = best.solution.at_bound[k] && !unknown.is_physical_bound(value);
      const FittedUnknown& fitted = result.unknowns[k];
      const double sigma = fitted.sigma / std::abs(unknown.slope(value));
      const bool beyond = settings_.strictly_within && fitted.determined &&
                          !unknown.is_within(value, tolerance * sigma + 1e-9);
      if (at_end || beyond) return static_cast<int>(k);
    }
    return -1;
  };
  const auto refuse = [&](FitProblem problem, Misfit misfit = Misfit::none) {
    result.problem = problem;
    result.misfit = misfit;
  };
  if (best.judged != Judged::good && is_periodic(events_, settings_.jitter.value_or(0.0)))
    return refuse(FitProblem::degenerate_orbit);
  if (best.judged == Judged::unconverged) {
    // An unconverged fit whose times fit lies in a valley of solutions.
    const bool valley = settings_.jitter ? result.chi2 < result.largest_chi2
                                         : result.scatter < nearly_exact * interval_;
    return refuse(valley ? FitProblem::degenerate_orbit : FitProblem::no_convergence);
  }
  if (result.used_share() < least_used) return refuse(FitProblem::events_left_out);
  if (best.judged == Judged::scatter) {
    if (has_merged_bounces(family_.scene(), events_)) return refuse(FitProblem::merged_bounces);
    result.culprit = end_of_range();
    const bool at_end = result.culprit >= 0;
    return refuse(at_end ? FitProblem::bound_reached : FitProblem::wrong_model, Misfit::scatter);
  }
  if (best.judged == Judged::inside) {
    put_inside(best, result);
    return refuse(FitProblem::lost_or_spurious_events);
  }
  if (best.solution.largest_start > largest_start) {
    return refuse(FitProblem::wrong_model, Misfit::start);
  }
  if (has_lost_its_scale(best)) return refuse(FitProblem::degenerate_orbit);
  result.culprit =
      determination.at_end_of_range >= 0 ? determination.at_end_of_range : end_of_range();
  if (result.culprit >= 0) return refuse(FitProblem::bound_reached);
  if (!determination.nominal_fits) {
    put_combinations(best, result);
    return refuse(FitProblem::degenerate_orbit);
  }
  // The effect of a record's errors depends on the motion; the deviations include it.
  if (result.record_errors.explains(result.scatter)) return;
  if (is_unpredictable(best, result)) return refuse(FitProblem::wrong_model, Misfit::prediction);
  if (is_structured(result)) return refuse(FitProblem::wrong_model, Misfit::structured);
}

Identification Identifier::run() {
  Identification result;
  const auto n = static_cast<std::size_t>(family_.n());
  interval_ = usual_interval(cut(events_, known_record(), 2));
  result.interval = interval_;
  Stretches stretches = stretches_of(close, settings_.through_contact, settings_.jitter);
  if (equations(stretches) < needed(stretches)) {
    throw TooFewImpacts(
        stretches.empty()
            ? "no part of the record has " + std::to_string(2 * n + 2) +
                  " single impacts in a row; the start alone takes " + std::to_string(2 * n)
            : "the record has " + std::to_string(count(stretches)) + " impacts that count; " +
                  std::to_string(needed(stretches)) + " are needed at least for " +
                  std::to_string(family_.unknowns().size() + 2 * n * stretches.size()) +
                  " unknowns" + (settings_.jitter ? "" : " and a jitter that is not given"));
  }
  Attempt best = attempt(stretches);
  from_nominal(stretches, best);
  from_narrower(stretches, best);
  // Bounces of a chatter may be too close together for their jitter.
  const Stretches coarse = stretches_of(less_close, settings_.through_contact, settings_.jitter);
  if (!best.good() && settings_.jitter != 0.0 && count(coarse) != count(stretches) &&
      equations(coarse) >= needed(coarse)) {
    Attempt other = attempt(coarse);
    if (other.good()) best = std::move(other);
  }
  cut_by_the_jitter(best);
  through_bounces(best);
  // Runs before any repair, because a repair could make the recording fit another machine.
  from_fewer(stretches, best);
  if (!best.good() && settings_.mend) {
    // Close bounces and spurious detections are hard to distinguish with jitter.
    const bool jitters = settings_.jitter.value_or(0.0) > 0.0;
    const Stretches flights = stretches_of(jitters ? less_close : close, false, settings_.jitter);
    if (!flights.empty()) mends(flights, settings_.jitter, best);
    // A given jitter that is too small admits no solution: estimates it.
    if (!flights.empty() && !best.good() && jitters) mends(flights, std::nullopt, best);
  }
  if (!best.exists()) {
    result.problem = FitProblem::no_convergence;
    result.fitted = family_.scene();
    return result;
  }
  conclude(best, result);
  // A structured scatter may mean a wrong minimum: searches for a far better one.
  const bool doubtful = result.departure.is_scatter() || result.departure.is_structured();
  if (best.good() && settings_.white && !settings_.jitter && doubtful) {
    good_limit_ = better_by * best.solution.scatter();
    Attempt other = attempt(stretches);
    if (other.good() && other.solution.scatter() < better_by * best.solution.scatter()) {
      best = std::move(other);
      Identification again;
      again.interval = interval_;
      conclude(best, again);
      result = std::move(again);
    }
  }
  put_verdict(best, result);
  return result;
}

// Fills in the result except for its verdict.
void Identifier::conclude(Attempt& best, Identification& result) {
  determination_ = {};
  std::vector<std::size_t> held;
  const bool is_optimum =
      best.good() || (best.judged == Judged::scatter && best.solution.converged);
  if (is_optimum) {
    const double sigma = std::max(best.jitter, best.solution.scatter());
    determination_ = determine(family_, best.stretches, best.solution, rivals(best), sigma);
    if (!best.held.empty()) {
      include_held(family_, best.stretches, best.held, sigma, determination_);
    }
    best.solution = determination_.solution;
    for (std::size_t k = 0; k < determination_.unknowns.size(); ++k) {
      if (determination_.nominal_fits && !determination_.unknowns[k].determined) held.push_back(k);
    }
  }
  describe(best, determination_, result);
  if (!is_optimum) return;
  if (best.good()) predict(best, held, result);
  result.departure = estimate_departure(family_.scene(), result);
  include(result.departure, result);
  include_record_errors(best, held, result);
}

// The uncertainty by errors of the recorded inputs.
void Identifier::include_record_errors(const Attempt& best, std::span<const std::size_t> held,
                                       Identification& result) const {
  const double sigma = std::max(best.jitter, best.solution.scatter());
  result.record_errors =
      estimate_record_errors(family_, best.stretches, best.solution, held, sigma);
  const RecordErrors& errors = result.record_errors;
  if (errors.empty()) return;
  // An estimated jitter is the rest of the scatter, or a share of it that is not known better.
  constexpr double least = 0.3;
  double of_jitter = 1.0;
  if (!settings_.jitter && result.scatter > 0.0) {
    const double by_record = errors.scatter() / result.scatter;
    of_jitter = std::sqrt(std::max(1.0 - square(by_record), square(least)));
  }
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    FittedUnknown& fitted = result.unknowns[k];
    const double slope = std::abs(fitted.unknown.slope(fitted.value));
    fitted.of_record = errors.of(k) * slope;
    const double sigma_of_all = std::hypot(of_jitter * fitted.sigma, fitted.of_record);
    const double wider = deviations * (sigma_of_all - fitted.sigma);
    fitted.sigma = sigma_of_all;
    fitted.low -= wider;
    fitted.high += wider;
    constexpr double largest_share = 0.5;  // of the range of the search
    const double range = std::max(-fitted.unknown.lowest(), fitted.unknown.highest());
    if (!(errors.of(k) < largest_share * range)) fitted.determined = false;
  }
  const auto add = [](Eigen::VectorXd& all, const Eigen::VectorXd& more) {
    all = (all.cwiseAbs2() + more.cwiseAbs2()).cwiseSqrt().eval();
  };
  add(result.start_sigma.q, errors.start.q);
  add(result.start_sigma.u, errors.start.u);
}

}  // namespace

Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings, std::stop_token stop) {
  const StopScope scope(std::move(stop));
  IdentificationSettings determinable = settings;
  const std::vector<RecordedInput> records = recorded_inputs(scene);
  if (std::any_of(records.begin(), records.end(),
                  [](const RecordedInput& record) { return record.input->noise() > 0.0; })) {
    // A noisy record makes event times scatter by more than their jitter, and not independently.
    determinable.jitter.reset();
    determinable.white = false;
  }
  std::vector<ClockAmbiguity> ambiguities;
  std::vector<FittedUnknown> held;
  std::erase_if(determinable.unknowns, [&](const Unknown& unknown) {
    const auto ambiguity = clock_ambiguity(scene, settings.unknowns, unknown);
    if (!ambiguity) return false;
    ambiguities.push_back(*ambiguity);
    held.push_back({.unknown = unknown, .value = unknown.nominal, .determined = false});
    return true;
  });
  Identification result = Identifier(scene, events, determinable).run();
  result.ambiguities = std::move(ambiguities);
  result.unknowns.insert(result.unknowns.end(), held.begin(), held.end());
  if (result.converged()) result.fitted = fitted_scene(scene, result);
  return result;
}

}  // namespace sprag
