#include "sprag/detail/identification/search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Events that must agree: of the first window beyond the unknowns, after a change, and by which a
// window must grow before it explains the rest of the record. At the end of a record fewer do.
constexpr std::size_t agreeing = 4, least_agreeing = 2;
// Points of the design over the ranges, for one parameter and at most.
constexpr std::size_t points_of_one = 64, most_points = 1200, points_of_split = 150;
// Candidates that are kept; that are refined, or explain too few events before no more are tried.
constexpr std::size_t kept_candidates = 12, most_tried = 4;
constexpr double rounding_of_times = 1e-13;
// Events that a new piece may skip, and changes that one comparison with the path may make;
// impacts in a row that may be lost, and between two pieces.
constexpr std::size_t most_skipped = 3, most_lost = 2, most_lost_between = 8;
// Price of a change beyond twice the logarithm of the number of events.
constexpr double price_of_change = 4.0;
// Explanations with changes that are compared, and windows with two starts that are tried.
constexpr std::size_t most_finished = 3, most_splits = 60;
// Logarithm of a chance that is none.
constexpr double certain = 25.0;
constexpr int most_rounds = 8;
// A curved valley of the cost goes on where the scatter falls below this share.
constexpr double lower_by = 0.9;

FitPoint recorded_point(const std::vector<FitStretch>& parts, const GaussNewton::Held& held) {
  FitPoint point{held.c, held.starts, {}};
  for (const FitStretch& part : parts) {
    point.times.emplace_back();
    for (const FitEvent& event : part.events) point.times.back().push_back(event.t);
  }
  return point;
}

void add_lost(std::span<const FitEvent> lost, Chain& chain) {
  for (const FitEvent& event : lost) chain.changes.push_back({event.t, event.contact, true, 0});
}

// Moves back along the path to just before an impact, which the path has at `time`. False: none
// leads there.
bool pass_back(FamilyFlight& flight, int contact, double time, PathPoint& at) {
  if (at.held != 0 || flight.restitution(contact) == 0.0) return false;
  flight.fly(at.x, at.t, time - at.t, at.held);
  VectorXd along(at.x.size());
  flight.along(contact, along);
  const double after = flight.gap(contact).velocity;
  // epsilon(v) v is the speed after the impact.
  double before = -after / flight.restitution(contact);
  for (int round = 0; round < most_rounds; ++round) {
    before = -after / flight.restitution(contact, before);
  }
  if (!std::isfinite(before)) return false;
  at.x = flight.x() - (after - before) * along;
  at.t = time;
  return true;
}

}  // namespace

double largest_misfit(int freedom) { return 1.0 + six * std::sqrt(2.0 / std::max(freedom, 1)); }

double largest_rise(double n, const EventFit& fit, bool given) {
  const double of_events = n + six * std::sqrt(2.0 * n) + six;
  return given ? of_events : of_events * largest_misfit(fit.freedom);
}

FitSearch::FitSearch(GaussNewton& solver, const FitRecord& record, std::optional<double> jitter,
                     bool changes, double neglected, std::function<void(std::size_t)> progress)
    : solver_(&solver),
      record_(&record),
      jitter_(jitter),
      changes_(changes),
      neglected_(neglected),
      floor_(rounding_of_times * record.end),
      progress_(std::move(progress)) {
  if (jitter_) jitter_ = std::max(*jitter_, floor_);
  solver_->resolve(jitter_.value_or(negligible_scatter * record.interval));
}

double FitSearch::sigma(double rms) const { return jitter_.value_or(std::max(rms, floor_)); }

double FitSearch::variance(const EventFit& fit) const {
  return jitter_ ? square(*jitter_) : std::max(fit.variance(), square(floor_));
}

// Variance of the times in the decisions of the search.
double FitSearch::tolerated(const EventFit& fit) const {
  return std::max(variance(fit), square(neglected_ * record_->interval));
}

// An additive recurrence of low discrepancy over the ranges, after the nominal values.
std::vector<VectorXd> FitSearch::design(std::size_t count) const {
  const Index P = solver_->parameters();
  std::vector<VectorXd> points{VectorXd::Zero(P)};
  if (P == 0) return points;
  double root = 1.5;  // of root^(P + 1) = root + 1
  for (int i = 0; i < 60; ++i) root = std::pow(1.0 + root, 1.0 / static_cast<double>(P + 1));
  for (std::size_t i = 1; i <= count; ++i) {
    VectorXd c(P);
    for (Index k = 0; k < P; ++k) {
      const double share =
          0.5 + static_cast<double>(i) * std::pow(root, -static_cast<double>(k + 1));
      const bool bounded = std::isfinite(solver_->low()[k]);
      const double low = bounded ? std::max(solver_->low()[k], -1.1 * solver_->scale()[k]) : -3.14;
      const double high = bounded ? std::min(solver_->high()[k], 1.1 * solver_->scale()[k]) : 3.14;
      c[k] = low + (high - low) * (share - std::floor(share));
    }
    points.push_back(std::move(c));
  }
  return points;
}

// Cuts of the record that no change explains.
std::size_t FitSearch::unexplained(const Chain& chain) const {
  std::size_t cuts = 0;
  for (std::size_t i = 0; i < record_->stretches.size(); ++i) {
    const auto pieces = std::count_if(chain.pieces.begin(), chain.pieces.end(),
                                      [&](const Piece& piece) { return piece.stretch == i; });
    if (pieces > 1) cuts += static_cast<std::size_t>(pieces) - 1;
    if (pieces == 0) continue;
    std::size_t low = record_->stretches[i].size(), high = 0;
    for (const Piece& piece : chain.pieces) {
      if (piece.stretch != i) continue;
      low = std::min(low, piece.low);
      high = std::max(high, piece.high);
    }
    if (low > most_skipped) ++cuts;
    if (record_->stretches[i].size() - high > most_skipped) ++cuts;
  }
  return cuts;
}

std::vector<FitStretch> Chain::parts() const {
  std::vector<FitStretch> all;
  for (const Piece& piece : pieces) all.push_back(piece.part);
  return all;
}

std::size_t Chain::spanned() const {
  std::size_t events = 0;
  for (const Piece& piece : pieces) events += piece.high - piece.low;
  return events;
}

std::size_t FitSearch::shortest() const { return static_cast<std::size_t>(2 * solver_->n()) + 4; }

std::size_t FitSearch::usable() const {
  std::size_t events = 0;
  for (const FitStretch& stretch : record_->stretches) {
    if (stretch.size() >= shortest()) events += stretch.size();
  }
  return std::max(events, record_->stretches.front().size());
}

void FitSearch::report(const std::vector<FitStretch>& parts) const {
  if (!progress_) return;
  std::size_t events = 0;
  for (const FitStretch& part : parts) events += part.size();
  progress_(events);
}

// Fits parts that differ little from those of a fit, from its point, and from the recorded times
// where this fails.
std::optional<EventFit> FitSearch::refit(std::vector<FitStretch> parts, const EventFit& from) {
  report(parts);
  const GaussNewton::Held held = solver_->hold(parts, from.point.c, 6);
  const bool holds = held.rms < 2.0 * largest_scatter * record_->interval;
  FitPoint recorded = recorded_point(parts, held);
  FitPoint near = recorded;
  near.c = from.point.c;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (std::size_t j = 0; j < from.stretches.size(); ++j) {
      const FitStretch& known = from.stretches[j];
      if (known.start == parts[i].start && known.held == parts[i].held)
        near.starts[i] = from.point.starts[j];
      std::size_t k = 0;
      for (std::size_t l = 0; l < parts[i].size(); ++l) {
        const double t = parts[i].events[l].t;
        while (k < known.size() && known.events[k].t < t) ++k;
        if (k < known.size() && known.events[k].t == t) near.times[i][l] = from.point.times[j][k];
      }
    }
  }
  const double of_times = sigma(holds ? held.rms : std::sqrt(from.variance()));
  EventFit warm = solver_->refine(parts, std::move(near), of_times, most_iterations);
  if (!warm.stretches.empty() && warm.converged) return warm;
  if (holds) {
    EventFit cold =
        solver_->refine(std::move(parts), std::move(recorded), of_times, most_iterations);
    const bool better = !cold.stretches.empty() && !(warm.cost < cold.cost);
    if (warm.stretches.empty() || better) warm = std::move(cold);
  }
  if (warm.stretches.empty()) return std::nullopt;
  return warm;
}

// So many events agree so well that it is no chance.
bool FitSearch::is_certain(const EventFit& fit) const {
  return fit.freedom * std::log(record_->interval / std::sqrt(tolerated(fit))) > certain;
}

// No impact comes from inside, and the scatter is small.
bool FitSearch::plausible(const EventFit& fit) const {
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    double typical = 0.0;
    std::size_t impacts = 0;
    const FitStretch& stretch = fit.stretches[i];
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      if (!stretch.events[k].impact()) continue;
      typical += std::abs(fit.velocities[i][k]);
      ++impacts;
    }
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      const double of = fit.velocities[i][k];
      const FitEvent& event = stretch.events[k];
      const bool counts = event.impact() && event.informs;
      if (counts && of * static_cast<double>(impacts) > largest_scatter * typical) return false;
    }
  }
  const double most = jitter_ ? std::max(*jitter_, negligible_scatter * record_->interval)
                              : std::max(largest_scatter, 2.0 * neglected_) * record_->interval;
  return fit.variance() < square(most) * largest_misfit(fit.freedom);
}

bool FitSearch::agrees(const EventFit& wider, const EventFit& fit, double added) const {
  const double most = largest_rise(std::max(added, 1.0), fit, jitter_.has_value());
  return plausible(wider) && (wider.squares - fit.squares) / tolerated(fit) < most;
}

std::vector<Chain> FitSearch::candidates(const std::vector<Piece>& pieces) {
  std::vector<FitStretch> parts;
  for (const Piece& piece : pieces) parts.push_back(piece.part);
  report(parts);
  const Index P = solver_->parameters();
  std::size_t count = P == 0 ? 0 : points_of_one;
  const std::size_t most = pieces.size() > 1 ? points_of_split : most_points;
  for (Index k = 1; k < P; ++k) count = std::min(most, 4 * count);
  std::vector<GaussNewton::Held> best;
  for (const VectorXd& c : design(count)) {
    best.push_back(solver_->project(parts, c));
    if (!std::isfinite(best.back().score)) best.back().score = infinity;
  }
  // The nominal values are kept.
  std::stable_sort(best.begin() + 1, best.end(),
                   [](const auto& a, const auto& b) { return a.score < b.score; });
  best.resize(std::min(best.size(), kept_candidates + 1));
  for (GaussNewton::Held& held : best) held = solver_->hold(parts, held.c, 25);
  std::stable_sort(best.begin(), best.end(),
                   [](const auto& a, const auto& b) { return a.score < b.score; });
  std::vector<Chain> chains;
  std::vector<VectorXd> seen;
  const double worst =
      std::max(30.0 * jitter_.value_or(0.0), 2.0 * largest_scatter * record_->interval);
  for (const GaussNewton::Held& held : best) {
    if (!(held.rms < worst) || seen.size() == most_tried) break;
    const auto near = [&](const VectorXd& other) {
      return P == 0 ||
             (held.c - other).cwiseQuotient(solver_->scale()).cwiseAbs().maxCoeff() < 1e-3;
    };
    if (std::any_of(seen.begin(), seen.end(), near)) continue;
    seen.push_back(held.c);
    EventFit fit =
        solver_->refine(parts, recorded_point(parts, held), sigma(held.rms), most_iterations);
    if (fit.stretches.empty() || !plausible(fit)) continue;
    const auto same = [&](const Chain& other) { return near(other.fit.point.c) && P > 0; };
    if (std::any_of(chains.begin(), chains.end(), same)) continue;
    chains.push_back({pieces, std::move(fit), {}});
  }
  return chains;
}

// Replaces a piece if the events that this adds agree.
bool FitSearch::replace(Chain& chain, std::size_t piece, Piece by, double added) {
  std::vector<FitStretch> parts = chain.parts();
  parts[piece] = by.part;
  std::optional<EventFit> wider = refit(std::move(parts), chain.fit);
  if (!wider || !agrees(*wider, chain.fit, added)) return false;
  chain.pieces[piece] = std::move(by);
  chain.fit = std::move(*wider);
  return true;
}

// Extends a piece by as many events as agree, down to one at a time.
void FitSearch::grow(Chain& chain, std::size_t piece, bool forwards, bool repairs) {
  const FitStretch& stretch = record_->stretches[chain.pieces[piece].stretch];
  std::size_t failed = stretch.size();  // by so many events
  for (;;) {
    const Piece& now = chain.pieces[piece];
    std::size_t room = forwards ? stretch.size() - now.high : now.low;
    for (std::size_t i = 0; i < chain.pieces.size(); ++i) {
      const Piece& other = chain.pieces[i];
      if (i == piece || other.stretch != now.stretch) continue;
      if (forwards && other.low >= now.high) room = std::min(room, other.low - now.high);
      if (!forwards && other.high <= now.low) room = std::min(room, now.low - other.high);
    }
    std::size_t d =
        std::min(room, std::max<std::size_t>(1, std::min(now.high - now.low, failed) / 2));
    for (; d >= 1; failed = d, d /= 2) {
      Piece wider{
          now.stretch, forwards ? now.low : now.low - d, forwards ? now.high + d : now.high, {}};
      if (forwards) {
        wider.part = now.part;
        const auto more = std::span(stretch.events).subspan(now.high, d);
        wider.part.events.insert(wider.part.events.end(), more.begin(), more.end());
      } else {
        wider.part = stretch.part(wider.low, now.low);
        wider.part.events.insert(wider.part.events.end(), now.part.events.begin(),
                                 now.part.events.end());
      }
      if (replace(chain, piece, std::move(wider), static_cast<double>(d))) break;
    }
    if (d > 0) {
      failed -= std::min(failed, d);
      continue;
    }
    const double most = largest_share_changed * static_cast<double>(record_->events);
    if (!repairs || !changes_ || room == 0 ||
        static_cast<double>(chain.changes.size()) >= std::max(1.0, most))
      return;
    if (!repair(chain, piece, forwards)) return;
    failed = stretch.size();
  }
}

// Adds a piece with a start of its own if its events agree.
bool FitSearch::begin_piece(Chain& chain, std::size_t stretch, std::size_t low, std::size_t high,
                            bool forwards) {
  Piece piece{stretch, low, high, record_->stretches[stretch].part(low, high)};
  if (!piece.part.events.front().impact() && piece.part.held == 0) return false;
  std::vector<FitStretch> parts = chain.parts();
  parts.push_back(piece.part);
  std::optional<EventFit> wider = refit(std::move(parts), chain.fit);
  const double added = static_cast<double>(high - low) - static_cast<double>(2 * solver_->n());
  if (!wider || !agrees(*wider, chain.fit, added)) return false;
  chain.pieces.push_back(std::move(piece));
  chain.fit = std::move(*wider);
  grow(chain, chain.pieces.size() - 1, forwards, true);
  return true;
}

// Explains the events from `from` to `to` - 1 of a stretch by further pieces.
void FitSearch::continue_in(Chain& chain, std::size_t stretch, std::size_t from, std::size_t to,
                            bool forwards) {
  for (std::size_t skipped = 0; skipped <= most_skipped;) {
    const std::size_t size = std::min(shortest(), to - from);
    if (size + 1 < shortest() || size < skipped + shortest() - 1) return;
    const std::size_t low =
        forwards ? from + skipped : to - skipped - std::min(size, to - from - skipped);
    const std::size_t high = forwards ? std::min(low + size, to) : to - skipped;
    if (!begin_piece(chain, stretch, low, high, forwards)) {
      ++skipped;
      continue;
    }
    skipped = 0;
    (forwards ? from : to) = forwards ? chain.pieces.back().high : chain.pieces.back().low;
  }
}

void FitSearch::complete(Chain& chain) {
  grow(chain, chain.pieces.size() - 1, true, true);
  grow(chain, 0, false, true);
  const std::size_t own = chain.pieces.front().stretch;
  std::size_t low = chain.pieces.front().low, high = 0;
  for (const Piece& piece : chain.pieces) {
    low = std::min(low, piece.low);
    high = std::max(high, piece.high);
  }
  continue_in(chain, own, high, record_->stretches[own].size(), true);
  continue_in(chain, own, 0, low, false);
  for (std::size_t i = 0; i < record_->stretches.size(); ++i) {
    if (i != own) continue_in(chain, i, 0, record_->stretches[i].size(), true);
  }
}

// Impacts of the path after the first `events` of a piece that precede `next`. Empty: the path
// does not come to `next`.
std::optional<std::vector<FitEvent>> FitSearch::lost_events(const Chain& chain, std::size_t piece,
                                                            std::size_t events,
                                                            const FitEvent& next,
                                                            std::size_t most) {
  FamilyFlight& flight = solver_->flight();
  PathPoint at = beyond(chain, piece, chain.pieces[piece].part.size() - events, true);
  std::vector<FitEvent> lost;
  const double tolerance = beside_event * std::min(record_->interval, next.t - at.t);
  while (lost.size() <= most) {
    if (!flight.can_hold(at.held)) return std::nullopt;
    const std::optional<FitEvent> first = next_impact(at.x, at.t, next.t + tolerance, at.held);
    if (!first || first->t > next.t) return lost;
    if (first->contact == next.contact && first->t > next.t - tolerance) return lost;
    lost.push_back(*first);
    pass(flight, *first, first->t, at);
  }
  return std::nullopt;
}

// The first impact of the free path between t and `until`, which may be earlier.
std::optional<FitEvent> FitSearch::next_impact(const VectorXd& x, double t, double until,
                                               ContactSet held) {
  FamilyFlight& flight = solver_->flight();
  constexpr int steps = 400;
  const double h = (until - t) / steps;
  std::vector<double> last(static_cast<std::size_t>(flight.contacts()), -1.0);
  for (int i = 1; i <= steps; ++i) {
    flight.fly(x, t, i * h, held);
    std::optional<FitEvent> first;
    for (int contact = 0; contact < flight.contacts(); ++contact) {
      if (contains(held, contact)) continue;
      double& before = last[static_cast<std::size_t>(contact)];
      const double g = flight.gap(contact).g;
      if (before > 0.0 && g <= 0.0) {
        first = FitEvent{t + (i - 1 + before / (before - g)) * h, contact, ContactEventKind::pulse,
                         false, 0};
      }
      before = g;
    }
    if (first) return first;
  }
  return std::nullopt;
}

// A dropped event within `beside` [s] of an inserted one is this event.
void FitSearch::restore_moved(Chain& chain, double beside) {
  std::vector<EventChange>& changes = chain.changes;
  for (std::size_t i = 0; i < changes.size();) {
    const EventChange lost = changes[i];
    const auto dropped = std::find_if(changes.begin(), changes.end(), [&](const EventChange& of) {
      return lost.inserted && !of.inserted && of.contact == lost.contact &&
             std::abs(of.t - lost.t) < beside;
    });
    if (dropped == changes.end()) {
      ++i;
      continue;
    }
    for (Piece& piece : chain.pieces) {
      for (FitEvent& event : piece.part.events) {
        if (event.timed || event.t != lost.t || event.contact != lost.contact) continue;
        event.t = dropped->t;
        event.timed = true;
        event.index = dropped->index;
      }
    }
    const EventChange of_record = *dropped;
    std::erase_if(changes, [&](const EventChange& of) {
      return of.inserted ? of.t == lost.t && of.contact == lost.contact
                         : of.index == of_record.index;
    });
    i = 0;
  }
}

// Takes a chain with a changed piece as `best` if its events agree and it is the cheapest: a change
// costs twice the logarithm of the number of events.
void FitSearch::consider(Chain changed, const Chain& chain, double added, Option& best) {
  restore_moved(changed, six * std::sqrt(tolerated(chain.fit)));
  std::optional<EventFit> fitted = refit(changed.parts(), chain.fit);
  if (!fitted || !agrees(*fitted, chain.fit, added)) return;
  const double count = static_cast<double>(changed.changes.size() - chain.changes.size());
  const double cost = fitted->squares / tolerated(chain.fit) +
                      2.0 * count * std::log(static_cast<double>(record_->events));
  if (best.chain && cost >= best.price) return;
  changed.fit = std::move(*fitted);
  best = {std::move(changed), cost};
}

// Removes events of the record from a path. Returns whether they may be spurious.
bool FitSearch::drop(std::span<const FitEvent> events, Chain& chain) {
  for (const FitEvent& event : events) {
    if (event.kind != ContactEventKind::pulse) return false;
    if (event.timed) chain.changes.push_back({event.t, event.contact, false, event.index});
  }
  return true;
}

// Continues piece `first` to events `low` to `high` - 1 of its stretch, without its last `from_a`
// events, and with the impacts that the path has before them.
std::optional<Chain> FitSearch::continued(const Chain& chain, std::size_t first, std::size_t from_a,
                                          std::size_t low, std::span<const FitEvent> next,
                                          std::size_t high, std::size_t most) {
  const Piece& a = chain.pieces[first];
  const FitStretch& stretch = record_->stretches[a.stretch];
  Chain changed = chain;
  std::vector<FitEvent> events = a.part.events;
  const std::size_t kept_of_a = events.size() - from_a;
  if (!drop(std::span(events).subspan(kept_of_a), changed)) return std::nullopt;
  events.resize(kept_of_a);
  if (!drop(std::span(stretch.events).subspan(a.high, low - a.high), changed)) return std::nullopt;
  const auto lost = lost_events(chain, first, kept_of_a, next.front(), most);
  if (!lost) return std::nullopt;
  add_lost(*lost, changed);
  events.insert(events.end(), lost->begin(), lost->end());
  events.insert(events.end(), next.begin(), next.end());
  changed.pieces[first] = {a.stretch, a.low, high, {a.part.start, a.part.held, std::move(events)}};
  return changed;
}

// Joins a piece and the next one of its stretch to one path.
bool FitSearch::connect(Chain& chain, std::size_t first) {
  std::optional<std::size_t> second;
  for (std::size_t i = 0; i < chain.pieces.size(); ++i) {
    const Piece& other = chain.pieces[i];
    const bool after =
        other.stretch == chain.pieces[first].stretch && other.low >= chain.pieces[first].high;
    if (after && (!second || other.low < chain.pieces[*second].low)) second = i;
  }
  if (!second) return false;
  const Piece a = chain.pieces[first], b = chain.pieces[*second];
  Option best;
  for (std::size_t from_a = 0; from_a <= 1; ++from_a) {
    for (std::size_t from_b = 0; from_b <= 1; ++from_b) {
      if (a.part.size() < from_a + 2 || b.part.size() < from_b + 2) continue;
      const std::span<const FitEvent> next = std::span(b.part.events).subspan(from_b);
      auto changed = continued(chain, first, from_a, b.low, next, b.high, most_lost_between);
      if (!changed || !drop(std::span(b.part.events).first(from_b), *changed)) continue;
      changed->pieces.erase(changed->pieces.begin() + static_cast<std::ptrdiff_t>(*second));
      consider(std::move(*changed), chain, static_cast<double>(2 * solver_->n()), best);
    }
  }
  if (!best.chain) return false;
  chain = std::move(*best.chain);
  return true;
}

// A change of the events at the end of a piece, after which the next ones agree.
bool FitSearch::repair(Chain& chain, std::size_t piece, bool forwards) {
  const Piece a = chain.pieces[piece];
  const FitStretch& stretch = record_->stretches[a.stretch];
  const std::size_t room = forwards ? stretch.size() - a.high : a.low;
  Option best;
  for (const std::size_t most : {agreeing, least_agreeing}) {
    for (std::size_t from_a = 0; from_a <= 1; ++from_a) {
      for (std::size_t skipped = 0; skipped <= 1; ++skipped) {
        if (room < skipped + least_agreeing) continue;
        const std::size_t taken = std::min(room - skipped, most);
        const double added = static_cast<double>(taken) - static_cast<double>(from_a);
        const std::size_t low = forwards ? a.high + skipped : a.low - skipped - taken;
        auto changed = forwards ? continued(chain, piece, from_a, low,
                                            std::span(stretch.events).subspan(low, taken),
                                            low + taken, most_lost)
                                : preceded(chain, piece, from_a, low, low + taken);
        if (changed) consider(std::move(*changed), chain, added, best);
      }
    }
    if (best.chain) break;
  }
  for (std::size_t from_a = 0; from_a <= 1 && !best.chain; ++from_a) {
    if (a.part.size() < from_a + 2) break;
    if (auto changed = aligned(chain, piece, from_a, forwards)) {
      const double added =
          static_cast<double>(changed->spanned()) - static_cast<double>(chain.spanned());
      consider(std::move(*changed), chain, added, best);
    }
  }
  if (!best.chain) return false;
  chain = std::move(*best.chain);
  return true;
}

// The path of a piece beyond one of its ends, without the `from_a` events there.
PathPoint FitSearch::beyond(const Chain& chain, std::size_t piece, std::size_t from_a,
                            bool forwards) {
  FamilyFlight& flight = solver_->flight();
  flight.set(chain.fit.point.c, false);
  const FitStretch& part = chain.pieces[piece].part;
  const std::vector<double>& times = chain.fit.point.times[piece];
  PathPoint at{chain.fit.point.starts[piece], part.start, part.held};
  if (forwards) {
    for (std::size_t k = 0; k + from_a < part.size(); ++k) {
      pass(flight, part.events[k], times[k], at);
    }
    return at;
  }
  flight.fly(at.x, at.t, times.front() - at.t, at.held);
  if (from_a > 0) flight.strike(part.events.front().contact, false, part.held);
  at.x = flight.x();
  at.t = times.front();
  return at;
}

// Impacts of the path between `last` and a piece without its first `from_a` events, in order of
// time. Empty: the path does not come from `last`.
std::optional<std::vector<FitEvent>> FitSearch::earlier_events(const Chain& chain,
                                                               std::size_t piece,
                                                               std::size_t from_a,
                                                               const FitEvent& last) {
  PathPoint at = beyond(chain, piece, from_a, false);
  std::vector<FitEvent> lost;
  const double tolerance = beside_event * std::min(record_->interval, at.t - last.t);
  while (lost.size() <= most_lost) {
    const std::optional<FitEvent> first = next_impact(at.x, at.t, last.t - tolerance, at.held);
    if (!first || first->t < last.t) break;
    if (first->contact == last.contact && first->t < last.t + tolerance) break;
    if (!pass_back(solver_->flight(), first->contact, first->t, at)) return std::nullopt;
    lost.insert(lost.begin(), *first);
  }
  if (lost.size() > most_lost) return std::nullopt;
  return lost;
}

// Extends a piece, without `from_a` events at its end, by the next events as its path has them:
// impacts without an event are lost, events without an impact spurious.
std::optional<Chain> FitSearch::aligned(const Chain& chain, std::size_t piece, std::size_t from_a,
                                        bool forwards) {
  const Piece& a = chain.pieces[piece];
  const std::vector<FitEvent>& recorded = record_->stretches[a.stretch].events;
  const auto own = std::span(a.part.events);
  Chain changed = chain;
  if (!drop(forwards ? own.last(from_a) : own.first(from_a), changed)) return std::nullopt;
  PathPoint at = beyond(chain, piece, from_a, forwards);
  std::vector<FitEvent> events;
  const std::size_t room = forwards ? recorded.size() - a.high : a.low;
  std::size_t used = 0, matched = 0, used_then = 0, events_then = 0, changes_then = 0;
  while (matched < agreeing && used < room &&
         changed.changes.size() <= chain.changes.size() + most_skipped) {
    const FitEvent& next = recorded[forwards ? a.high + used : a.low - 1 - used];
    const double tolerance = beside_event * std::min(record_->interval, std::abs(next.t - at.t));
    const double until = forwards ? next.t + tolerance : next.t - tolerance;
    const std::optional<FitEvent> impact = next_impact(at.x, at.t, until, at.held);
    const bool same =
        impact && impact->contact == next.contact && std::abs(impact->t - next.t) < tolerance;
    const bool is_before = impact && (forwards ? impact->t < next.t : impact->t > next.t);
    if (same || !is_before) {
      if (next.kind != ContactEventKind::pulse) break;
      ++used;
    }
    if (!same && !is_before) {
      if (!drop({&next, 1}, changed)) break;
      continue;
    }
    events.push_back(same ? next : *impact);
    if (!same) add_lost({&*impact, 1}, changed);
    if (forwards) {
      pass(solver_->flight(), *impact, impact->t, at);
    } else if (!pass_back(solver_->flight(), impact->contact, impact->t, at)) {
      break;
    }
    if (!same) continue;
    ++matched;
    used_then = used;
    events_then = events.size();
    changes_then = changed.changes.size();
  }
  if (matched < std::min(room, least_agreeing) || changes_then == chain.changes.size())
    return std::nullopt;
  events.resize(events_then);
  changed.changes.resize(changes_then);
  Piece wider = a;
  if (forwards) {
    wider.high += used_then;
    wider.part.events.resize(own.size() - from_a);
    wider.part.events.insert(wider.part.events.end(), events.begin(), events.end());
  } else {
    wider.low -= used_then;
    std::reverse(events.begin(), events.end());
    events.insert(events.end(), own.begin() + static_cast<std::ptrdiff_t>(from_a), own.end());
    wider.part = record_->stretches[a.stretch].part(wider.low, wider.low + 1);
    wider.part.events = std::move(events);
  }
  changed.pieces[piece] = std::move(wider);
  return changed;
}

// Puts events `low` to `high` - 1 of its stretch before a piece, without its first `from_a` events.
std::optional<Chain> FitSearch::preceded(const Chain& chain, std::size_t piece, std::size_t from_a,
                                         std::size_t low, std::size_t high) {
  const Piece& a = chain.pieces[piece];
  const FitStretch& stretch = record_->stretches[a.stretch];
  Chain changed = chain;
  const std::span<const FitEvent> own(a.part.events);
  if (!drop(own.first(from_a), changed)) return std::nullopt;
  if (!drop(std::span(stretch.events).subspan(high, a.low - high), changed)) return std::nullopt;
  FitStretch part = stretch.part(low, high);
  const FitEvent& last = part.events.back();
  if (last.kind == ContactEventKind::closes) return std::nullopt;
  auto lost = earlier_events(chain, piece, from_a, last);
  if (!lost) return std::nullopt;
  add_lost(*lost, changed);
  part.events.insert(part.events.end(), lost->begin(), lost->end());
  part.events.insert(part.events.end(), own.begin() + static_cast<std::ptrdiff_t>(from_a),
                     own.end());
  changed.pieces[piece] = {a.stretch, low, a.high, std::move(part)};
  return changed;
}

void FitSearch::mend(Chain& chain) {
  for (std::size_t i = 0; i < chain.pieces.size();) {
    if (connect(chain, i)) {
      i = 0;
    } else {
      ++i;
    }
  }
}

// Drops the event with the largest residual while the likelihood gains more than its price.
void FitSearch::prune(Chain& chain) {
  const double price = 2.0 * std::log(static_cast<double>(record_->events)) + price_of_change;
  while (static_cast<double>(chain.changes.size()) <
         largest_share_changed * static_cast<double>(record_->events)) {
    Option best;
    double largest = 0.0;
    std::size_t in_piece = 0, at = 0;
    for (std::size_t i = 0; i < chain.pieces.size(); ++i) {
      const FitStretch& part = chain.pieces[i].part;
      for (std::size_t k = 0; k < part.size(); ++k) {
        const FitEvent& event = part.events[k];
        if (!event.timed || event.kind != ContactEventKind::pulse) continue;
        const double e = std::abs(chain.fit.point.times[i][k] - event.t);
        if (e > largest) largest = e, in_piece = i, at = k;
      }
    }
    if (square(largest) < 9.0 * variance(chain.fit) ||
        largest < negligible_scatter * record_->interval)
      return;
    Chain changed = chain;
    FitStretch& part = changed.pieces[in_piece].part;
    const FitEvent event = part.events[at];
    part = part.without(at);
    changed.changes.push_back({event.t, event.contact, false, event.index});
    std::optional<EventFit> fitted = refit(changed.parts(), chain.fit);
    if (!fitted || !plausible(*fitted)) return;
    const double gain =
        jitter_ ? (chain.fit.squares - fitted->squares) / square(*jitter_)
                : chain.fit.freedom *
                      std::log(chain.fit.variance() / std::max(fitted->variance(), square(floor_)));
    if (gain < price) return;
    changed.fit = std::move(*fitted);
    chain = std::move(changed);
  }
}

// Restores events that were dropped, and inserted elsewhere, along a path with too few changes.
void FitSearch::restore(Chain& chain) {
  Chain changed = chain;
  restore_moved(changed, beside_event * record_->interval);
  if (changed.changes.size() == chain.changes.size()) return;
  std::optional<EventFit> fitted = refit(changed.parts(), chain.fit);
  if (!fitted || !plausible(*fitted)) return;
  changed.fit = std::move(*fitted);
  if (price(changed) < price(chain)) chain = std::move(changed);
}

// Iterates to the minimum. Without a jitter the weights follow the scatter.
void FitSearch::polish(Chain& chain) {
  for (int round = 0; round < most_rounds; ++round) {
    const double before = chain.fit.squares;
    EventFit fit = solver_->refine(chain.fit.stretches, chain.fit.point,
                                   sigma(std::sqrt(chain.fit.variance())), most_iterations);
    if (fit.stretches.empty() || !(fit.squares <= before * (1.0 + 1e-3) + square(floor_))) return;
    chain.fit = std::move(fit);
    if (chain.fit.converged && chain.fit.squares > 0.98 * before) return;
  }
}

// Follows a curved valley of the cost, where steps by the derivatives end: shifts each weakly
// determined parameter with the others free. Returns whether the scatter has become smaller.
bool FitSearch::descend(Chain& chain) {
  const EventFit& fit = chain.fit;
  const double share = variance(fit) / square(fit.sigma);
  for (Index k = 0; k < solver_->parameters(); ++k) {
    const double deviation = std::sqrt(fit.covariance(k, k) * share);
    if (!(deviation > weakly_determined * solver_->scale()[k])) continue;
    for (const double side : {1.0, -1.0}) {
      std::optional<EventFit> lower;
      double least = lower_by * fit.squares;
      for (double distance = 2.0 * deviation; distance < solver_->scale()[k]; distance *= 2.0) {
        FitPoint point = fit.point;
        point.c[k] += side * distance;
        if (point.c[k] < solver_->low()[k] || point.c[k] > solver_->high()[k]) break;
        EventFit other =
            solver_->refine(fit.stretches, std::move(point), fit.sigma, most_iterations, k);
        if (other.stretches.empty() || !(other.squares < least)) break;
        least = other.squares;
        lower = std::move(other);
      }
      if (!lower) continue;
      EventFit free = solver_->refine(lower->stretches, lower->point,
                                      sigma(std::sqrt(lower->variance())), most_iterations);
      if (free.stretches.empty() || !plausible(free) || free.squares > least) continue;
      chain.fit = std::move(free);
      return true;
    }
  }
  return false;
}

// Twice the negative logarithm of the likelihood of a record; an event that the chain does not
// explain is anywhere in a usual interval.
double FitSearch::price(const Chain& chain) const {
  const double N = static_cast<double>(record_->events);
  const double variance = tolerated(chain.fit);
  double used = 0.0;
  for (const Piece& piece : chain.pieces) {
    for (const FitEvent& event : piece.part.events) used += event.timed;
  }
  double inserted = 0.0;
  for (const EventChange& change : chain.changes) inserted += change.inserted;
  const double starts = static_cast<double>(2 * solver_->n() * std::ssize(chain.pieces));
  const double of_event = std::log(square(record_->interval) / variance);
  return chain.fit.squares / variance - used * of_event +
         (2.0 * std::log(N) + price_of_change) * inserted + starts * of_event;
}

std::vector<std::vector<Piece>> FitSearch::windows(std::size_t number, bool split) const {
  const FitStretch& stretch = record_->stretches[number];
  const auto starts = static_cast<std::size_t>(2 * solver_->n());
  const std::size_t unknowns = starts + static_cast<std::size_t>(solver_->parameters());
  std::vector<std::vector<Piece>> all;
  std::vector<std::pair<std::size_t, std::size_t>> places;
  const auto add = [&](std::size_t half, std::size_t extra) {
    const std::size_t length = std::min(unknowns + extra + (split ? starts : 0), stretch.size());
    const std::size_t low = std::min(half * length / 2, stretch.size() - length);
    const std::pair place{low, low + length};
    if (std::find(places.begin(), places.end(), place) == places.end()) places.push_back(place);
  };
  constexpr std::array<std::size_t, 6> halves{0, 2, 4, 1, 6, 8};
  constexpr std::array<std::size_t, 2> extras{2 * agreeing, agreeing};
  if (split) {
    // The begin of a record tells most about its machine: the rest may be a settled orbit.
    for (const std::size_t half : halves)
      for (const std::size_t extra : extras) add(half, extra);
  } else {
    for (const std::size_t extra : extras)
      for (const std::size_t half : halves) add(half, extra);
  }
  for (const auto& [low, high] : places) {
    if (!split) {
      all.push_back({{number, low, high, stretch.part(low, high)}});
      continue;
    }
    // Without one event, which may be spurious, or beside which one may be lost.
    const std::size_t least = starts + 1;
    for (std::size_t k = 0; low == 0 && k < least && k + least < high; ++k) {
      all.push_back({{number, k + 1, high, stretch.part(k + 1, high)}});
    }
    for (std::size_t k = low + least; k + 1 + least <= high; ++k) {
      all.push_back({{number, low, k, stretch.part(low, k)},
                     {number, k + 1, high, stretch.part(k + 1, high)}});
    }
    if (all.size() > most_splits) break;
  }
  return all;
}

// The first impact of a piece's path that has no event, and the number of the event after it.
std::optional<std::pair<FitEvent, std::size_t>> FitSearch::unrecorded(const Chain& chain,
                                                                      std::size_t piece) {
  FamilyFlight& flight = solver_->flight();
  flight.set(chain.fit.point.c, false);
  const FitStretch& part = chain.pieces[piece].part;
  PathPoint at{chain.fit.point.starts[piece], part.start, part.held};
  double typical = 0.0;
  for (const double velocity : chain.fit.velocities[piece]) typical += std::abs(velocity);
  typical /= static_cast<double>(part.size());
  for (std::size_t k = 0; k < part.size(); ++k) {
    const double tau = chain.fit.point.times[piece][k];
    if (k > 0) {
      const std::optional<FitEvent> first = next_impact(at.x, at.t, tau, at.held);
      if (first && first->t < tau - beside_event * (tau - at.t)) {
        flight.fly(at.x, at.t, first->t - at.t, at.held);
        if (-flight.gap(first->contact).velocity > largest_scatter * typical) return {{*first, k}};
      }
    }
    pass(flight, part.events[k], tau, at);
  }
  return std::nullopt;
}

// Inserts the impacts of the path that have no event, if a path with all of them agrees. If none
// does, the gaps between the events are not determined well enough to tell.
void FitSearch::insert_unrecorded(Chain& chain) {
  const double most = largest_share_changed * static_cast<double>(record_->events);
  Chain changed = chain;
  for (std::size_t piece = 0; piece < chain.pieces.size(); ++piece) {
    while (const auto found = unrecorded(changed, piece)) {
      const auto& [event, k] = *found;
      changed.pieces[piece].part = changed.pieces[piece].part.with(k, event);
      add_lost({&event, 1}, changed);
      std::optional<EventFit> fitted = refit(changed.parts(), changed.fit);
      const bool agrees = fitted && this->agrees(*fitted, chain.fit, 1.0);
      if (!agrees || static_cast<double>(changed.changes.size()) > most) return;
      changed.fit = std::move(*fitted);
    }
  }
  chain = std::move(changed);
}

// Inserts impacts of the path between the begin of the record and its first event.
void FitSearch::begin_record(Chain& chain) {
  const auto first =
      std::find_if(chain.pieces.begin(), chain.pieces.end(), [&](const Piece& piece) {
        return piece.low == 0 && piece.part.events.front().index == 0 && piece.part.held == 0;
      });
  const double begins = record_->begins;
  if (first == chain.pieces.end() || first->part.start <= begins) return;
  const auto piece = static_cast<std::size_t>(first - chain.pieces.begin());
  const auto lost = earlier_events(chain, piece, 0, {begins, -1});
  if (!lost || lost->empty()) return;
  Chain changed = chain;
  FitStretch& part = changed.pieces[piece].part;
  part.events.insert(part.events.begin(), lost->begin(), lost->end());
  part.start = part.events.front().t;
  add_lost(*lost, changed);
  std::optional<EventFit> fitted = refit(changed.parts(), chain.fit);
  if (!fitted || !agrees(*fitted, chain.fit, 1.0)) return;
  changed.fit = std::move(*fitted);
  chain = std::move(changed);
}

void FitSearch::explain(Chain& chain) {
  chain.explained = true;
  complete(chain);
  if (changes_) mend(chain);
  if (changes_) prune(chain);
  if (changes_) restore(chain);
  if (changes_) begin_record(chain);
  insert_unrecorded(chain);
  polish(chain);
}

bool FitSearch::explains(const Chain& chain) const {
  return static_cast<double>(chain.spanned()) >=
         least_share_explained * static_cast<double>(usable());
}

void Chain::sort_by_time() {
  std::vector<std::size_t> order(pieces.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
    return pieces[i].part.start < pieces[j].part.start;
  });
  const auto sorted = [&](auto& all) {
    auto moved = all;
    for (std::size_t i = 0; i < order.size(); ++i) moved[i] = std::move(all[order[i]]);
    all = std::move(moved);
  };
  sorted(pieces);
  sorted(fit.stretches);
  sorted(fit.point.starts);
  sorted(fit.point.times);
  sorted(fit.velocities);
}

std::vector<Chain> FitSearch::run() {
  const std::size_t unknowns = static_cast<std::size_t>(2 * solver_->n() + solver_->parameters());
  std::vector<Chain> tried;
  const auto cheaper = [&](const Chain& a, const Chain& b) { return price(a) < price(b); };
  // Windows that led to an explanation of the record, unless that of a part is likelier.
  std::size_t explained = 0;
  const auto finished = [&] {
    const auto best = std::min_element(tried.begin(), tried.end(), cheaper);
    return best != tried.end() && explains(*best) ? explained : 0;
  };
  for (const bool split : {false, true}) {
    if (split && !changes_) break;
    std::size_t failed = 0;
    for (std::size_t i = 0; i < std::min<std::size_t>(record_->stretches.size(), split ? 1 : 3);
         ++i) {
      if (record_->stretches[i].size() < unknowns + 2 || failed >= most_tried) break;
      for (const std::vector<Piece>& pieces : windows(i, split)) {
        std::vector<Chain> here = candidates(pieces);
        for (Chain& chain : here) {
          grow(chain, chain.pieces.size() - 1, true, false);
          grow(chain, 0, false, false);
        }
        if (here.empty()) continue;
        std::stable_sort(here.begin(), here.end(), cheaper);
        const std::size_t window = pieces.back().high - pieces.front().low;
        const std::size_t least =
            std::min(window + (split ? 0 : agreeing), record_->stretches[i].size());
        const bool grown = here.front().spanned() >= least || is_certain(here.front().fit);
        if (grown) {
          explain(here.front());
          // Another minimum with less scatter may explain the record with changes.
          for (std::size_t k = 1; k < here.size(); ++k) {
            if (here[k].fit.variance() >= here.front().fit.variance()) continue;
            explain(here[k]);
            break;
          }
          std::stable_sort(here.begin(), here.end(), cheaper);
          while (!here.front().explained) {
            explain(here.front());
            std::stable_sort(here.begin(), here.end(), cheaper);
          }
        }
        const Chain& chain = here.front();
        const bool done = grown && explains(chain);
        const bool clean =
            done && chain.changes.empty() && chain.pieces.size() == record_->stretches.size();
        const double reached = price(chain);
        const bool again =
            grown && std::any_of(tried.begin(), tried.end(), [&](const Chain& other) {
              return other.explained && std::abs(price(other) - reached) < 1.0;
            });
        tried.insert(tried.end(), here.begin(), here.end());
        explained += done;
        failed += grown && !done;
        const bool ends = again && (!split || finished() > 0);
        if (clean || ends || finished() >= most_finished || failed >= most_tried) break;
      }
      if (finished() > 0) break;
    }
    if (finished() > 0) break;
  }
  std::stable_sort(tried.begin(), tried.end(), cheaper);
  if (finished() == 0 && !tried.empty() && !tried.front().explained) explain(tried.front());
  if (tried.empty() || !tried.front().explained) return tried;
  for (int round = 0; round < most_rounds && descend(tried.front()); ++round) {
    explain(tried.front());
  }
  return tried;
}

}  // namespace sprag
