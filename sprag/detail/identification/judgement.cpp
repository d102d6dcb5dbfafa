#include "sprag/detail/identification/judgement.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "sprag/detail/identification/departure.h"
#include "sprag/detail/identification/record_checks.h"
#include "sprag/detail/identification/record_errors.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_parameters.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A standard deviation above this share of the range determines nothing.
constexpr double determined_below = 0.5;
// Distance of a second profile, in ranges.
constexpr double far_away = 0.1;
// Largest scatter that may be a jitter, in usual intervals.
constexpr double largest_jitter = 0.01;
// Relative deviation and least weight of a combination that the events determine.
constexpr double known_combination = 0.05, least_weight = 0.1;
// Speeds that the inputs do not explain, relative to those that they cause in a usual interval.
constexpr double without_scale = 1e6;

// 1.4826 times the median of sizes: a standard deviation that ignores outliers.
double usual(std::vector<double> sizes) {
  if (sizes.empty()) return 0.0;
  const auto middle = sizes.begin() + std::ssize(sizes) / 2;
  std::nth_element(sizes.begin(), middle, sizes.end());
  return 1.4826 * *middle;
}

// Ljung & Box's test of residuals for correlation.
bool is_white(std::vector<double> e) {
  const double n = static_cast<double>(e.size());
  const double mean = std::accumulate(e.begin(), e.end(), 0.0) / n;
  double squares = 0.0, sum = 0.0;
  for (double& value : e) {
    value -= mean;
    squares += value * value;
  }
  const std::size_t lags = std::min<std::size_t>(10, e.size() / 4);
  for (std::size_t lag = 1; lag <= lags; ++lag) {
    double product = 0.0;
    for (std::size_t k = lag; k < e.size(); ++k) product += e[k] * e[k - lag];
    sum += square(product / squares) / (n - static_cast<double>(lag));
  }
  const double L = static_cast<double>(lags);
  return n * (n + 2.0) * sum < L + six * std::sqrt(2.0 * L) + six;
}

bool is_exact(const SearchContext& context, const EventFit& fit) {
  return std::sqrt(fit.variance()) < negligible_scatter * context.record.interval;
}

// Of the times: by the given jitter, else, and for exact times, by the scatter.
double variance_of(const SearchContext& context, const FitSearch& search, const EventFit& fit) {
  const double scatter = std::max(std::sqrt(fit.variance()), search.floor());
  const double jitter = context.settings.jitter.value_or(scatter);
  return square(is_exact(context, fit) ? std::max(jitter, scatter) : jitter);
}

class Judge {
 public:
  Judge(const SearchContext& context, GaussNewton& solver, const FitSearch& search,
        const std::vector<Chain>& chains)
      : context_(&context),
        unknowns_(&context.settings.unknowns),
        solver_(&solver),
        search_(&search),
        chains_(&chains),
        fit_(&chains.front().fit),
        variance_(variance_of(context, search, *fit_)),
        deviations_((fit_->covariance.diagonal() * (variance_ / square(fit_->sigma))).cwiseSqrt()) {
  }

  Identification run();

 private:
  bool given() const { return context_->settings.jitter.has_value(); }
  const Chain& chain() const { return chains_->front(); }
  double rise(const EventFit& other) const { return (other.squares - fit_->squares) / variance_; }
  bool is_exact() const { return sprag::is_exact(*context_, *fit_); }
  bool is_determined(Index k) const {
    return deviations_[k] < determined_below * solver_->scale()[k];
  }
  void profile(Index k, double distance);
  void profile();
  void compare(const EventFit& other);
  int bound() const;
  bool scatters() const;
  bool moves_event() const;
  bool lacks_scale() const;
  bool predicts(Identification& result);
  bool begins_record(const FitStretch& stretch) const;
  void put_numbers(Identification& result) const;
  void put_unknowns(Identification& result) const;
  void put_combinations(Identification& result) const;
  void put_path(Identification& result);
  void include_record_errors(Identification& result) const;
  void put_verdict(Identification& result);

  const SearchContext* context_;
  const std::vector<Parameter>* unknowns_;
  GaussNewton* solver_;
  const FitSearch* search_;
  const std::vector<Chain>* chains_;
  const EventFit* fit_;
  double variance_;
  VectorXd deviations_;
};

// Widens the deviation of a parameter if the cost rises less than its curvature says, at a distance
// from the optimum in the parameter's coordinate.
void Judge::profile(Index k, double distance) {
  for (const double side : {1.0, -1.0}) {
    FitPoint point = fit_->point;
    point.c[k] += side * distance;
    if (point.c[k] < solver_->low()[k] || point.c[k] > solver_->high()[k]) continue;
    const EventFit other = solver_->refine(fit_->stretches, point, fit_->sigma, most_iterations, k);
    if (other.stretches.empty()) continue;
    const double by = std::max(rise(other), 0.05);
    if (by < 0.5 * square(distance / deviations_[k])) {
      deviations_[k] = std::max(deviations_[k], distance / std::sqrt(by));
    }
  }
}

// Profiles of the parameters: where their deviations are a share of the range, and, if the cost
// rises little along some, further away. On a locked orbit the others seem determined at the
// turning points of the curve of machines with these events.
void Judge::profile() {
  const Index P = solver_->parameters();
  bool weak = false;
  for (Index k = 0; k < P; ++k) {
    const double range = solver_->scale()[k];
    if (deviations_[k] < weakly_determined * range) continue;
    const double linear = deviations_[k];
    for (double before = 0.0; is_determined(k) && deviations_[k] > before;) {
      before = deviations_[k];
      profile(k, std::min(2.0 * before, determined_below * range));
    }
    weak = weak || !is_determined(k) || deviations_[k] > 2.0 * linear;
  }
  for (Index k = 0; weak && k < P; ++k) {
    if (is_determined(k)) profile(k, far_away * solver_->scale()[k]);
  }
}

// Values of another minimum that explains the events as well.
void Judge::compare(const EventFit& other) {
  for (Index k = 0; k < deviations_.size(); ++k) {
    const double off = std::abs(other.point.c[k] - fit_->point.c[k]);
    if (off > 5.0 * deviations_[k] + 1e-9) deviations_[k] = infinity;
  }
}

// The unknown that ends at or beyond its range; -1: none.
int Judge::bound() const {
  for (Index k = 0; k < deviations_.size(); ++k) {
    const Parameter& unknown = (*unknowns_)[static_cast<std::size_t>(k)];
    const double c = fit_->point.c[k], value = unknown.value(c);
    if (!is_determined(k)) continue;
    const bool end = c <= solver_->low()[k] + 1e-9 || c >= solver_->high()[k] - 1e-9;
    const bool beyond = context_->settings.strictly_within &&
                        !unknown.is_within(value, ruled_out * deviations_[k] + 1e-9);
    if ((end && !unknown.is_physical_bound(value)) || beyond) return static_cast<int>(k);
  }
  return -1;
}

bool Judge::scatters() const {
  if (given()) return fit_->squares / variance_ > fit_->freedom * largest_misfit(fit_->freedom);
  return std::sqrt(variance_) > largest_jitter * context_->record.interval;
}

// Whether an event is dropped and another one beside it inserted: its time is wrong.
bool Judge::moves_event() const {
  const std::vector<EventChange>& changes = chain().changes;
  const double beside = beside_event * context_->record.interval;
  return std::any_of(changes.begin(), changes.end(), [&](const EventChange& lost) {
    return lost.inserted && std::any_of(changes.begin(), changes.end(), [&](const auto& dropped) {
             return !dropped.inserted && dropped.contact == lost.contact &&
                    std::abs(dropped.t - lost.t) < beside;
           });
  });
}

// Whether the motion is so large that the inputs, which set its scale, do not matter.
bool Judge::lacks_scale() const {
  const Model& model = context_->scene.model;
  const double interval = context_->record.interval;
  double inputs = 0.0, speed = 0.0;
  const CholeskyFactor M(model.M);
  for (const Contact& contact : model.contacts) {
    inputs = std::max({inputs, std::abs(contact.clearance), std::abs(contact.motion.amplitude)});
    const VectorXd by_force = M.solve(contact.w);
    for (const Force& force : model.forces) {
      const double size = std::abs(force.constant) + std::abs(force.harmonic.amplitude);
      inputs = std::max(inputs, std::abs(by_force.dot(force.direction)) * size * square(interval));
    }
  }
  for (const std::vector<double>& of : fit_->velocities) {
    for (const double velocity : of) speed = std::max(speed, std::abs(velocity));
  }
  return inputs > 0.0 && recorded_inputs(context_->scene).empty() &&
         speed * interval > without_scale * inputs;
}

// Whether the first four fifths predict the last fifth.
bool Judge::predicts(Identification& result) {
  const std::size_t total = fit_->events(), first = total - total / 5;
  std::vector<FitStretch> before;
  FitPoint point{fit_->point.c, {}, {}};
  std::size_t events = 0;
  double added = 0.0;
  for (std::size_t i = 0; i < fit_->stretches.size(); ++i) {
    const FitStretch& stretch = fit_->stretches[i];
    const std::size_t size = std::min(stretch.size(), first - std::min(first, events));
    events += stretch.size();
    const bool counts = size > static_cast<std::size_t>(2 * solver_->n());
    for (std::size_t k = counts ? size : 0; k < stretch.size(); ++k) {
      added += stretch.events[k].timed;
    }
    if (!counts) continue;
    before.push_back(stretch.part(0, size));
    point.starts.push_back(fit_->point.starts[i]);
    point.times.emplace_back(fit_->point.times[i].begin(),
                             fit_->point.times[i].begin() + static_cast<std::ptrdiff_t>(size));
  }
  const auto unknowns = static_cast<std::size_t>(2 * solver_->n() + solver_->parameters());
  if (added < 3.0 || before.empty() || first < unknowns * before.size() + 3) return true;
  const std::vector<FitStretch> fitted = before;
  const EventFit earlier = solver_->refine(std::move(before), point, fit_->sigma, 8);
  if (earlier.stretches.empty()) return true;
  // The later times from the fit to the earlier ones.
  EventFit all = *fit_;
  all.point.c = earlier.point.c;
  std::size_t of = 0;
  std::vector<double> inside, beyond;
  for (std::size_t i = 0; i < all.stretches.size() && of < fitted.size(); ++i) {
    if (all.stretches[i].start == fitted[of].start)
      all.point.starts[i] = earlier.point.starts[of++];
  }
  of = 0;
  const std::vector<std::vector<double>> misses = solver_->misses(all);
  for (std::size_t i = 0; i < misses.size() && of < fitted.size(); ++i) {
    if (all.stretches[i].start != fitted[of].start) continue;
    const std::size_t size = fitted[of++].size();
    std::size_t k = 0;
    for (const double miss : misses[i]) (k++ < size ? inside : beyond).push_back(miss);
  }
  result.predicted_before = usual(inside);
  result.predicted = usual(beyond);
  return (fit_->squares - earlier.squares) / variance_of(*context_, *search_, earlier) <
         largest_rise(added, earlier, given());
}

void Judge::put_numbers(Identification& result) const {
  const std::span<const ContactEvent> events = context_->events;
  result.jitter_given = given();
  result.jitter = std::sqrt(variance_);
  result.scatter = std::sqrt(fit_->variance());
  result.freedom = fit_->freedom;
  result.chi2 = fit_->squares / variance_;
  result.largest_chi2 = fit_->freedom * largest_misfit(fit_->freedom);
  result.stretches = static_cast<int>(fit_->stretches.size());
  result.interval = context_->record.interval;
  result.events = static_cast<int>(std::count_if(events.begin(), events.end(), [](const auto& of) {
    return of.kind != ContactEventKind::opens;
  }));
  for (const FitStretch& stretch : fit_->stretches) {
    for (const FitEvent& event : stretch.events) {
      result.impacts += event.impact() && event.timed;
    }
  }
  result.from = fit_->stretches.front().events.front().t;
  result.to = fit_->stretches.back().events.back().t;
  for (const EventChange& change : chain().changes) {
    if (change.inserted) {
      result.missing.push_back({change.t, change.contact});
    } else {
      result.spurious.push_back(change.index);
    }
  }
  std::sort(result.spurious.begin(), result.spurious.end());
  std::sort(result.missing.begin(), result.missing.end(),
            [](const MissingImpact& a, const MissingImpact& b) { return a.t < b.t; });
  result.spurious_left_out = static_cast<int>(result.spurious.size());
  result.left_out =
      std::max(0, result.events - result.impacts - static_cast<int>(context_->record.merged));
  // Where the path breaks off.
  const std::vector<Piece>& pieces = chain().pieces;
  for (std::size_t i = 1; i < pieces.size() && result.inside_to == 0.0; ++i) {
    if (pieces[i].stretch != pieces[i - 1].stretch) continue;
    result.inside_from = pieces[i - 1].part.events.back().t;
    result.inside_to = pieces[i].part.start;
  }
  if (result.inside_to == 0.0 && !chain().changes.empty()) {
    const auto [first, last] =
        std::minmax_element(chain().changes.begin(), chain().changes.end(),
                            [](const EventChange& a, const EventChange& b) { return a.t < b.t; });
    result.inside_from = first->t;
    result.inside_to = last->t;
  }
  // Or where it begins or ends.
  if (result.inside_to == 0.0) {
    const double first = events.front().t, last = events.back().t;
    const bool early = result.from - first > last - result.to;
    result.inside_from = early ? first : result.to;
    result.inside_to = early ? result.from : last;
  }
}

void Judge::put_unknowns(Identification& result) const {
  const Index P = solver_->parameters();
  result.covariance = fit_->covariance * (variance_ / square(fit_->sigma));
  const MatrixXd& covariance = result.covariance;
  for (Index k = 0; k < P; ++k) {
    const Parameter& unknown = (*unknowns_)[static_cast<std::size_t>(k)];
    const double c = fit_->point.c[k], deviation = deviations_[k];
    FittedUnknown fitted{.unknown = unknown, .value = unknown.value(c)};
    if (quantity(unknown.key) == "phase") {
      fitted.value =
          unknown.nominal + std::remainder(fitted.value - unknown.nominal, 2.0 * std::numbers::pi);
    }
    fitted.determined = is_determined(k);
    fitted.sigma = deviation * std::abs(unknown.slope(fitted.value));
    fitted.at_bound = (c <= solver_->low()[k] + 1e-9 || c >= solver_->high()[k] - 1e-9) &&
                      unknown.is_physical_bound(fitted.value);
    const double at = unknown.coordinate(fitted.value);
    fitted.low = unknown.value(std::max(at - of_interval * deviation, solver_->low()[k]));
    fitted.high = unknown.value(std::min(at + of_interval * deviation, solver_->high()[k]));
    for (Index j = 0; j < P; ++j) {
      const double scale = std::sqrt(covariance(k, k) * covariance(j, j));
      if (j == k || !(scale > 0.0) || !fitted.determined || !is_determined(j)) continue;
      const double correlation = covariance(k, j) / scale;
      if (fitted.partner < 0 || std::abs(correlation) > std::abs(fitted.correlation)) {
        fitted.partner = static_cast<int>(j);
        fitted.correlation = correlation;
      }
    }
    result.unknowns.push_back(std::move(fitted));
  }
}

// Principal directions in the space of the undetermined unknowns that the events do determine.
void Judge::put_combinations(Identification& result) const {
  std::vector<Index> open;
  for (Index k = 0; k < deviations_.size(); ++k) {
    if (!is_determined(k)) open.push_back(k);
  }
  const auto n = std::ssize(open);
  if (n < 2) return;
  const Eigenpairs pairs = eigenpairs(result.covariance(open, open), MatrixXd::Identity(n, n));
  for (Index j = 0; j < n; ++j) {
    const double variance = pairs.values[j];
    if (!(variance > 0.0) || !(variance < square(known_combination))) continue;
    Combination combination{.weights = {}, .sigma = std::sqrt(variance)};
    for (Index i = 0; i < n; ++i) {
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

// Whether no event but spurious ones precedes a stretch.
bool Judge::begins_record(const FitStretch& stretch) const {
  const auto first = std::find_if(stretch.events.begin(), stretch.events.end(),
                                  [](const FitEvent& event) { return event.timed; });
  if (stretch.held != context_->settings.closed || first == stretch.events.end()) return false;
  const std::size_t before = first->index;
  const auto spurious = std::count_if(
      chain().changes.begin(), chain().changes.end(),
      [&](const EventChange& change) { return !change.inserted && change.index < before; });
  return static_cast<std::size_t>(spurious) == before;
}

// Residuals and the start.
void Judge::put_path(Identification& result) {
  const GaussNewton::Spread spread = solver_->spread(*fit_);
  const double sigma = std::sqrt(variance_);
  for (std::size_t i = 0; i < fit_->stretches.size(); ++i) {
    for (std::size_t k = 0; k < fit_->stretches[i].size(); ++k) {
      const FitEvent& event = fit_->stretches[i].events[k];
      if (!event.timed || !event.informs) continue;
      const double left = 1.0 - spread.leverage[i][k];
      result.residuals.push_back({event.t, event.contact, event.index,
                                  event.t - fit_->point.times[i][k],
                                  left > 1e-9 ? sigma * std::sqrt(left) : 0.0, event.impact()});
    }
  }
  // The machine's time is (t - shift) / scale.
  const ContactClock &clock = context_->scene.clock, &fitted = result.fitted.clock;
  const double scale = fitted.rate / clock.rate;
  const double shift = (fitted.offset - clock.offset) / clock.rate;
  FamilyFlight& flight = solver_->flight();
  const FitStretch& stretch = fit_->stretches.front();
  const Index n = solver_->n();
  VectorXd x = fit_->point.starts.front();
  MatrixXd of_start = spread.start * (variance_ / square(fit_->sigma));
  double t = stretch.start;
  flight.set(fit_->point.c, false);
  // Back to the begin of the record, if no event is between.
  const double begins = context_->settings.begins;
  if (begins_record(stretch)) {
    const double to = begins == 0.0 ? shift : begins;
    flight.fly(x, t, to - t, stretch.held);
    x = flight.x();
    MatrixXd carried = MatrixXd::Identity(2 * n, 2 * n);
    flight.carry(carried);
    of_start = congruent(carried.transpose(), of_start);
    t = to;
  }
  result.start = {VectorXd(n), VectorXd(n)};
  flight.state(x, t, result.start.q, result.start.u);
  result.start.u *= scale;
  const MatrixXd& to_state = flight.to_state();
  const VectorXd variances = congruent(to_state.transpose(), of_start).diagonal().cwiseMax(0.0);
  result.start_sigma = {variances.head(n).cwiseSqrt(), scale * variances.tail(n).cwiseSqrt()};
  result.start_t = (t - shift) / scale;
  result.begins = begins == 0.0 ? 0.0 : (begins - shift) / scale;
}

void Judge::include_record_errors(Identification& result) const {
  result.record_errors = estimate_record_errors(
      context_->scene, *unknowns_, context_->settings.strictly_within, *fit_, std::sqrt(variance_));
  const RecordErrors& errors = result.record_errors;
  if (errors.empty()) return;
  // An estimated jitter is the rest of the scatter, or a share of it that is not known better.
  constexpr double least = 0.3;
  double of_jitter = 1.0;
  if (!given() && result.scatter > 0.0) {
    of_jitter = std::sqrt(std::max(1.0 - square(errors.scatter() / result.scatter), square(least)));
  }
  for (std::size_t k = 0; k < result.unknowns.size(); ++k) {
    FittedUnknown& fitted = result.unknowns[k];
    fitted.of_record = errors.of(k) * std::abs(fitted.unknown.slope(fitted.value));
    fitted.widen(std::hypot(of_jitter * fitted.sigma, fitted.of_record));
    if (!(errors.of(k) < determined_below * solver_->scale()[static_cast<Index>(k)])) {
      fitted.determined = false;
    }
  }
  const auto add = [](VectorXd& all, const VectorXd& more) {
    all = (all.cwiseAbs2() + more.cwiseAbs2()).cwiseSqrt().eval();
  };
  add(result.start_sigma.q, errors.start.q);
  add(result.start_sigma.u, errors.start.u);
}

void Judge::put_verdict(Identification& result) {
  const std::size_t usable = search_->usable();
  const auto changes = static_cast<double>(chain().changes.size());
  const double most_changes = std::max(2.0, largest_share_changed * static_cast<double>(usable));
  const double needed = least_share_explained * static_cast<double>(usable);
  const bool explained = static_cast<double>(fit_->events()) >= needed;
  const bool exact = is_exact(), predicts = this->predicts(result);
  const bool explained_by_record = result.record_errors.explains(result.scatter);
  const auto& unknowns = result.unknowns;
  const bool any =
      unknowns.empty() || std::any_of(unknowns.begin(), unknowns.end(),
                                      [](const FittedUnknown& of) { return of.determined; });
  const bool rivals =
      !result.others.empty() && std::none_of(unknowns.begin(), unknowns.end(),
                                             [](const FittedUnknown& of) { return of.determined; });
  const Cause cause = result.departure.cause;
  const bool structured = context_->settings.white && !exact && !result.departure.is_scatter() &&
                          (cause != Cause::none || (!given() && !is_white(fit_->residuals())));
  const bool noisy = given() && (result.departure.is_drift() || result.departure.is_scatter());
  result.culprit = bound();
  // The first row that holds is the verdict.
  struct Check {
    FitProblem problem;
    Misfit misfit;
    bool holds;
  };
  const Check checks[] = {
      {FitProblem::no_convergence, Misfit::none,
       !exact && !fit_->converged && fit_->remaining > std::max(1.0, 0.01 * fit_->cost)},
      {FitProblem::degenerate_orbit, Misfit::none, lacks_scale()},
      {FitProblem::events_left_out, Misfit::none, !explained},
      {FitProblem::lost_or_spurious_events, Misfit::none,
       changes > most_changes || moves_event() || (!exact && search_->unexplained(chain()) > 0)},
      {FitProblem::bound_reached, Misfit::none, result.culprit >= 0},
      {FitProblem::wrong_model, Misfit::scatter, scatters()},
      {FitProblem::degenerate_orbit, Misfit::none, !any || rivals},
      {FitProblem::wrong_model, Misfit::structured, structured && !explained_by_record && !noisy},
      {FitProblem::wrong_model, Misfit::prediction,
       !exact && !predicts && !explained_by_record && !result.departure.is_scatter()},
  };
  const auto first = std::find_if(std::begin(checks), std::end(checks),
                                  [](const Check& check) { return check.holds; });
  if (first == std::end(checks)) return;
  result.problem = first->problem;
  result.misfit = first->misfit;
  if (result.problem != FitProblem::bound_reached &&
      closings_per_period(context_->events, context_->settings.jitter.value_or(0.0)) > 0) {
    result.problem = FitProblem::degenerate_orbit;
    result.misfit = Misfit::none;
  } else if (result.problem != FitProblem::bound_reached &&
             result.problem != FitProblem::degenerate_orbit && !(explained && changes == 0.0) &&
             has_merged_bounces(context_->scene, context_->events)) {
    result.problem = FitProblem::merged_bounces;
    result.misfit = Misfit::none;
  }
  if (result.problem != FitProblem::degenerate_orbit) return;
  put_combinations(result);
  for (FittedUnknown& of : result.unknowns) of.determined = false;
}

Identification Judge::run() {
  Identification result;
  // Times that repeat determine no more values than there are in a period.
  const std::size_t repeated = closings_per_period(context_->events, std::sqrt(variance_));
  const bool repeats = repeated > 0 && static_cast<std::size_t>(solver_->parameters()) > repeated;
  for (Index k = 0; k < solver_->parameters(); ++k) {
    if (fit_->own_share[k] < least_own_share || repeats) {
      deviations_[k] = infinity;
    }
  }
  profile();
  for (const Chain& other : *chains_) {
    if (&other == &chain() ||
        search_->price(other) > search_->price(chain()) + significant_departure) {
      continue;
    }
    compare(other.fit);
    VectorXd values(solver_->parameters());
    for (Index k = 0; k < values.size(); ++k) {
      values[k] = (*unknowns_)[static_cast<std::size_t>(k)].value(other.fit.point.c[k]);
    }
    const double off = (other.fit.point.c - fit_->point.c).cwiseQuotient(solver_->scale()).norm();
    if (values.size() > 0 && off > 1e-3) result.others.push_back(std::move(values));
  }
  put_numbers(result);
  put_unknowns(result);
  VectorXd values(solver_->parameters());
  for (Index k = 0; k < values.size(); ++k) {
    values[k] = result.unknowns[static_cast<std::size_t>(k)].value;
  }
  result.fitted = with(context_->scene, *unknowns_, values);
  put_path(result);
  if (!is_exact()) {
    result.departure =
        estimate_departure(context_->scene, *unknowns_, *solver_, *fit_,
                           {std::sqrt(variance_), given(), context_->record.interval});
    include(result.departure, result);
  } else {
    result.departure.drift = DriftEstimate{};
  }
  include_record_errors(result);
  put_verdict(result);
  return result;
}

}  // namespace

Identification judge(const SearchContext& context, GaussNewton& solver, const FitSearch& search,
                     const std::vector<Chain>& chains) {
  return Judge(context, solver, search, chains).run();
}

}  // namespace sprag
