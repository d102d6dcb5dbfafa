#include "sprag/identification/identification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sprag/identification/bounces.h"
#include "sprag/identification/free_flight.h"
#include "sprag/identification/mending.h"
#include "sprag/identification/projection.h"
#include "sprag/identification/search.h"
#include "sprag/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// Of the usual time between impacts.
constexpr double exact = 2e-9;          // what is left of a fit to exact times
constexpr double least_jitter = 1e-10;  // times cannot be told apart
constexpr double untold = 0.05;         // unknown of a stretch's path, of which it tells nothing
constexpr double promising = 2e-3;  // a search ends where less is left, if the jitter is not told
constexpr double largest_jitter = 0.02;  // more than this is no jitter
// Impacts nearer to each other are not told apart; where they do not fit so, not these either.
constexpr double close = 3e-4, less_close = 0.0065;
constexpr double close_in_jitters = 10.0;
constexpr double search_in_jitters = 30.0;
// A flight that all but touches may seem to pass through, where its state is least sure.
constexpr double passage_in_jitters = 50.0;

double largest_chi2(int freedom) {
  const double of = std::max(freedom, 1);
  return of * (1.0 + 6.0 * std::sqrt(2.0 / of));
}

// A standard deviation of which a few large ones change little.
double usual(std::vector<double> sizes) {
  if (sizes.empty()) return 0.0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return 1.4826 * *middle;
}

struct Attempt {
  Stretches stretches;  // that it is a fit to
  Likelihood solution;
  std::vector<Eigen::VectorXd> others;
  double jitter = 0.0;  // told, or found
  FitProblem problem = FitProblem::not_found;
  int bounces = 0;  // that are passed, or were before they became impacts
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
  Attempt attempt(const Stretches& stretches) const;
  std::size_t needed(const Stretches& stretches) const;
  Likelihood maximize(const PathFit& found, Stretches& stretches) const;
  void cut_by_the_jitter(Attempt& best) const;
  void through_bounces(Attempt& best) const;
  FitProblem judge(const Likelihood& solution, double& jitter) const;
  bool comes_from_outside(const Likelihood& solution, double jitter) const;
  void mends(const Stretches& stretches, Attempt& best, Identification& result) const;
  void predict(const Attempt& best, Identification& result) const;
  void describe(const Attempt& best, Identification& result) const;
  void put_start(const Likelihood& solution, double sigma, Identification& result) const;

  double good() const {
    return settings_.jitter ? std::max(search_in_jitters * *settings_.jitter, exact * interval_)
                            : promising * interval_;
  }

  std::span<const ContactEvent> events_;
  const IdentificationSettings& settings_;
  MachineFamily family_;
  Stretches stretches_of(double closest, bool through_contact, std::optional<double> jitter) const;

  double interval_ = 0.0;
};

Stretches Identifier::stretches_of(double closest, bool through_contact,
                                   std::optional<double> jitter) const {
  RecordSettings record = known_record();
  if (through_contact) {
    record.can_follow = [nominal = family_.at(family_.nominal())](int contact, ContactSet held,
                                                                  ContactSet staying) {
      return is_one_impact(nominal, contact, held, staying);
    };
  }
  record.exact = settings_.jitter == 0.0;
  record.close = std::max(closest * interval_, close_in_jitters * jitter.value_or(0.0));
  return cut(events_, record, 2 * static_cast<std::size_t>(family_.n()) + 2);
}

bool Identifier::comes_from_outside(const Likelihood& solution, double jitter) const {
  const double allowed = passage_in_jitters * jitter + 1e3 * exact * interval_;
  const std::vector<StretchPath> checks = check_paths(family_, solution, jitter);
  return std::none_of(checks.begin(), checks.end(), [&](const StretchPath& check) {
    return check.hit_from_inside || !(check.inside < allowed);
  });
}

FitProblem Identifier::judge(const Likelihood& solution, double& jitter) const {
  if (!solution.values.allFinite() || !std::isfinite(solution.squares)) {
    return FitProblem::not_found;
  }
  jitter = std::max(settings_.jitter.value_or(solution.scatter()), least_jitter * interval_);
  if (!settings_.jitter && jitter > largest_jitter * interval_) return FitProblem::misfit;
  if (settings_.jitter && !(solution.squares / square(jitter) < largest_chi2(solution.freedom))) {
    return FitProblem::misfit;
  }
  if (!solution.converged && solution.scatter() > exact * interval_) return FitProblem::misfit;
  return comes_from_outside(solution, jitter) ? FitProblem::none : FitProblem::from_inside;
}

std::size_t Identifier::needed(const Stretches& of) const {
  return family_.unknowns().size() + 2 * static_cast<std::size_t>(family_.n()) * of.size() + 2;
}

// Where they do not fit otherwise, stretches whose times do not tell where the machine is in them,
// bounces of a chatter alone for one, are left out: they say no more of it than of their own start,
// and a path of theirs may be any.
Likelihood Identifier::maximize(const PathFit& found, Stretches& stretches) const {
  Likelihood solution = maximize_likelihood(family_, stretches, found);
  if (stretches.size() < 2 || !solution.values.allFinite()) return solution;
  double jitter = 0.0;
  if (judge(solution, jitter) == FitProblem::none) return solution;
  const std::vector<StretchPath> checks = check_paths(family_, solution, jitter);
  Stretches told;
  Likelihood start;
  start.values = solution.values;
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    if (!(checks[s].unknown < untold * interval_)) continue;
    told.push_back(stretches[s]);
    start.path.push_back(solution.path[s]);
    start.x0.push_back(solution.x0[s]);
  }
  if (told.size() == stretches.size() || equations(told) < needed(told)) return solution;
  Likelihood without = maximize_likelihood(family_, told, std::move(start));
  if (judge(without, jitter) != FitProblem::none) return solution;
  stretches = std::move(told);
  return without;
}

Attempt Identifier::attempt(const Stretches& stretches) const {
  const SearchResult found = search(family_, stretches, {good()});
  Attempt attempt;
  attempt.stretches = stretches;
  if (found.best.values.size() != family_.nominal().size()) return attempt;
  attempt.solution = maximize(found.best, attempt.stretches);
  attempt.problem = judge(attempt.solution, attempt.jitter);
  for (const PathFit& other : found.others) {
    Stretches of_other = stretches;
    const Likelihood solution = maximize(other, of_other);
    double jitter = 0.0;
    if (judge(solution, jitter) != FitProblem::none) continue;
    if (attempt.problem != FitProblem::none || solution.scatter() < attempt.solution.scatter()) {
      if (attempt.problem == FitProblem::none) attempt.others.push_back(attempt.solution.values);
      attempt.solution = solution;
      attempt.stretches = std::move(of_other);
      attempt.problem = FitProblem::none;
      attempt.jitter = jitter;
    } else {
      attempt.others.push_back(solution.values);
    }
  }
  // As good as the best by what the jitter makes of chi^2, or they are none.
  std::erase_if(attempt.others, [&](const Eigen::VectorXd& values) {
    return (values - attempt.solution.values).cwiseAbs().maxCoeff() == 0.0;
  });
  return attempt;
}

// What comes too soon after another is known when the jitter is.
void Identifier::cut_by_the_jitter(Attempt& best) const {
  if (settings_.jitter || best.problem != FitProblem::none) return;
  Attempt again;
  again.stretches = stretches_of(close, settings_.through_contact, best.jitter);
  if (count(again.stretches) == count(best.stretches) ||
      equations(again.stretches) < needed(again.stretches)) {
    return;
  }
  Projection projection(family_);
  projection.take(again.stretches);
  again.solution = maximize(projection.at(best.solution.values), again.stretches);
  again.problem = judge(again.solution, again.jitter);
  again.others = best.others;
  if (again.problem == FitProblem::none) best = std::move(again);
}

// Exact times are those of the machine's bounces. Bounces are sought along the solution, and, where
// that is none, along the measured times.
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
    with.problem = judge(with.solution, with.jitter);
    if (with.problem != FitProblem::none) continue;
    best = std::move(with);
    return;
  }
}

void Identifier::mends(const Stretches& stretches, Attempt& best, Identification& result) const {
  Mended mended = mend(family_, stretches, settings_.jitter, interval_);
  if (mended.spurious.empty() && mended.missing.empty()) return;
  Attempt again;
  again.solution = std::move(mended.solution);
  again.problem = judge(again.solution, again.jitter);
  if (again.problem != FitProblem::none) return;
  best = std::move(again);
  best.stretches = std::move(mended.stretches);
  result.spurious = std::move(mended.spurious);
  for (const Impact& impact : mended.missing) result.missing.push_back({impact.t, impact.contact});
}

// The fit to the first four fifths, and how far off it expects what comes.
void Identifier::predict(const Attempt& best, Identification& result) const {
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
  const Likelihood fit = maximize_likelihood(family_, before, std::move(start));
  if (!fit.values.allFinite()) return;
  result.first_squares = fit.squares;
  result.first_freedom = fit.freedom;
  // Along the measured times the path finds to the machine's, so that each impact is expected from
  // those before it.
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
        // Of an impact that hardly touches the time says little.
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

// `sigma`: of event times.
void Identifier::put_start(const Likelihood& solution, double sigma, Identification& result) const {
  const Machine machine = family_.at(solution.values);
  const Eigen::VectorXd inputs = family_.inputs(solution.values);
  const Eigen::Index n = family_.n();
  const double t = solution.path.front().start;
  Eigen::VectorXd y = solution.x0.front().head(n), u = solution.x0.front().tail(n);
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const std::complex<double> z(inputs[2 * g], inputs[2 * g + 1]);
    const std::complex<double> turn = z * std::polar(1.0, machine.frequencies[g] * t);
    y += (machine.response.col(g) * turn).real();
    u += (machine.response.col(g) * (turn * std::complex<double>(0.0, machine.frequencies[g])))
             .real();
  }
  const Eigen::MatrixXd& V = family_.V();
  result.start_t = t;
  result.start = {V * y, V * u};
  const Eigen::MatrixXd& covariance = solution.x0_covariance.front();
  const Eigen::MatrixXd of_q = congruent(V.transpose(), covariance.topLeftCorner(n, n));
  const Eigen::MatrixXd of_u = congruent(V.transpose(), covariance.bottomRightCorner(n, n));
  result.start_sigma = {sigma * of_q.diagonal().cwiseMax(0.0).cwiseSqrt(),
                        sigma * of_u.diagonal().cwiseMax(0.0).cwiseSqrt()};
}

void Identifier::describe(const Attempt& best, Identification& result) const {
  const Stretches& stretches = best.stretches;
  constexpr double noticeable = 0.05;  // of an undetermined direction
  const Likelihood& solution = best.solution;
  result.problem = best.problem;
  result.jitter = best.jitter;
  result.jitter_told = settings_.jitter.has_value();
  result.scatter = solution.scatter();
  result.freedom = solution.freedom;
  result.chi2 = solution.squares / square(best.jitter);
  result.largest_chi2 = largest_chi2(solution.freedom);
  result.impacts = solution.timed;
  result.stretches = static_cast<int>(stretches.size());
  result.from = stretches.front().impacts.front().t;
  result.to = stretches.back().impacts.back().t;
  result.interval = interval_;
  result.others = best.others;
  const double sigma = std::max(best.jitter, solution.scatter());
  const auto unknowns = static_cast<Eigen::Index>(family_.unknowns().size());
  for (Eigen::Index k = 0; k < unknowns; ++k) {
    FittedUnknown fitted{.unknown = family_.unknowns()[static_cast<std::size_t>(k)]};
    fitted.value = solution.values[k];
    if (fitted.unknown.kind == Kind::phase) {
      fitted.value = fitted.unknown.nominal +
                     std::remainder(fitted.value - fitted.unknown.nominal, 2.0 * std::numbers::pi);
    }
    const double variance = solution.covariance(k, k);
    fitted.sigma = sigma * std::sqrt(variance) * std::abs(fitted.unknown.slope(fitted.value));
    fitted.determined = solution.undetermined.cols() == 0 ||
                        solution.undetermined.row(k).cwiseAbs().maxCoeff() < noticeable;
    // A hundred percent, or all of a turn, or of the usual length.
    if (sigma * std::sqrt(variance) > 1.0) fitted.determined = false;
    for (Eigen::Index j = 0; j < unknowns; ++j) {
      const double scale = std::sqrt(variance * solution.covariance(j, j));
      if (j == k || !(scale > 0.0)) continue;
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
  result.fitted = family_.with(values);
  result.fitted.replica = result.start;
  result.fitted.jitter = result.jitter;
}

Identification Identifier::run() {
  Identification result;
  const auto n = static_cast<std::size_t>(family_.n());
  interval_ = usual_interval(cut(events_, known_record(), 2));
  Stretches stretches = stretches_of(close, settings_.through_contact, settings_.jitter);
  if (equations(stretches) < needed(stretches)) {
    throw TooFewImpacts(
        stretches.empty()
            ? "no part of the record has " + std::to_string(2 * n + 2) +
                  " single impacts in a row; the start alone takes " + std::to_string(2 * n)
            : "the record has " + std::to_string(count(stretches)) + " impacts that count; " +
                  std::to_string(needed(stretches)) + " are needed at least for " +
                  std::to_string(needed(stretches) - 2) + " unknowns");
  }
  for (const ContactEvent& event : events_) {
    if (event.kind == ContactEventKind::pulse) ++result.left_out;
  }
  Attempt best = attempt(stretches);
  // Bounces of a chatter may be too near to each other for their jitter.
  const Stretches coarse = stretches_of(less_close, settings_.through_contact, settings_.jitter);
  if (best.problem != FitProblem::none && settings_.jitter != 0.0 &&
      count(coarse) != count(stretches) && equations(coarse) >= needed(coarse)) {
    Attempt other = attempt(coarse);
    if (other.problem == FitProblem::none) best = std::move(other);
  }
  cut_by_the_jitter(best);
  through_bounces(best);
  if (best.problem != FitProblem::none && settings_.mend) {
    // Near to each other, a bounce and what is none are hard to tell apart.
    const bool jitters = settings_.jitter.value_or(0.0) > 0.0;
    const Stretches flights = stretches_of(jitters ? less_close : close, false, settings_.jitter);
    if (!flights.empty()) mends(flights, best, result);
  }
  if (best.solution.values.size() != family_.nominal().size()) {
    result.problem = FitProblem::not_found;
    result.interval = interval_;
    result.fitted = family_.scene();
    return result;
  }
  describe(best, result);
  result.left_out -= result.impacts + best.bounces + static_cast<int>(result.spurious.size());
  result.left_out = std::max(0, result.left_out);
  predict(best, result);
  // What the last fifth adds to the sum of squares is chi^2 with as many degrees of freedom, its
  // jitter that of the rest.
  const int added = result.freedom - result.first_freedom;
  if (result.fits() && result.first_freedom > 0 && added > 0) {
    const double jitter = settings_.jitter.value_or(0.0) > 0.0
                              ? *settings_.jitter
                              : std::sqrt(result.first_squares / result.first_freedom);
    const double squares = best.solution.squares - result.first_squares;
    if (squares > (square(jitter) + square(exact * interval_)) * largest_chi2(added)) {
      result.problem = FitProblem::unpredictable;
    }
  }
  return result;
}

}  // namespace

Identification identify(const Scene& scene, std::span<const ContactEvent> events,
                        const IdentificationSettings& settings) {
  return Identifier(scene, events, settings).run();
}

Explanations explain(const Scene& scene, std::span<const ContactEvent> events,
                     const IdentificationSettings& settings, double jitter) {
  Explanations explanations;
  IdentificationSettings of = settings;
  of.jitter = jitter;
  of.mend = false;
  const std::vector<Unknown>& all = settings.unknowns;
  const auto judge = [&](const std::vector<std::size_t>& sought) {
    of.unknowns.clear();
    Explanation explanation;
    for (const std::size_t k : sought) {
      of.unknowns.push_back(all[k]);
      explanation.keys.push_back(all[k].key);
    }
    try {
      explanation.fit = identify(scene, events, of);
    } catch (const TooFewImpacts&) {
      return;
    }
    if (explanation.fit.fits() && explanation.fit.missing.empty() &&
        explanation.fit.spurious.empty()) {
      explanations.simplest.push_back(std::move(explanation));
    }
  };
  judge({});
  if (explanations.simplest.empty()) {
    for (std::size_t j = 0; j < all.size(); ++j) judge({j});
  }
  if (explanations.simplest.empty()) {
    for (std::size_t j = 0; j < all.size(); ++j) {
      for (std::size_t k = j + 1; k < all.size(); ++k) judge({j, k});
    }
  }
  std::stable_sort(
      explanations.simplest.begin(), explanations.simplest.end(),
      [](const Explanation& a, const Explanation& b) { return a.fit.chi2 < b.fit.chi2; });
  return explanations;
}

}  // namespace sprag
