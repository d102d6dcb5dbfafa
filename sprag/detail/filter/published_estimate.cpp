#include "sprag/detail/filter/published_estimate.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "sprag/detail/filter/fall.h"
#include "sprag/detail/filter/flux.h"
#include "sprag/detail/filter/track.h"
#include "sprag/detail/filter/triangularize.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Largest number of unreported events that are mixed one after the other.
constexpr int most_unreported = 8;
// Least probability of either case: the tails of a predicted time are not Gaussian.
constexpr double least_probability = 1e-3;

// Probability that an event has happened, given that no report has come. `beyond`: the mean's
// distance past the event, in deviations of the gap. `ago`: time since then, in deviations of a
// report.
double probability(double beyond, double ago) {
  const double happened = normal_cdf(beyond) * normal_cdf(-ago);
  const double all = happened + normal_cdf(-beyond);
  return std::clamp(all > 0.0 ? happened / all : 1.0, least_probability, 1.0 - least_probability);
}

}  // namespace

PublishedEstimate::PublishedEstimate(LinearizedFlight& at, const FilterBelief& example)
    : at_(&at), mixed_(example) {
  const Eigen::Index columns = 2 * at.event_columns() + 2;
  x_.setZero(2 * at.n());
  earlier_ = x_;
  X_.setZero(2 * at.n(), at.event_columns());
  all_.setZero(at.size(), columns);
  reflector_.setZero(columns);
}

void PublishedEstimate::fly(double t, const FilterBelief& belief) {
  at_->spread(belief, t - belief.t);
  at_->fly(t, belief.z, belief);
}

void PublishedEstimate::find(double t, const FilterBelief& belief) {
  determined_ = !another_is_later(t, belief);
  fly(t, belief);
  if (belief.bursting != 0) {
    mix_unreported(t, belief);
    const Eigen::Index last = at_->X.cols() - 1;
    for_each(belief.bursting, [&](int i) {
      flight().along(i, x_);
      at_->X.col(last) += belief.rebound[i] * x_;
    });
    return;
  }
  const double s = belief.impact.time_sigma;
  const bool is_recent = s > 0.0 && t < belief.impact.time + certain * s;
  if (belief.sigma > 0.0 && !(is_recent && t < belief.impact.time)) mix_unreported(t, belief);
  if (is_recent) mix_last(t, belief);
}

// Whether a contact's event that was received before the last one is estimated to be later than t.
// The case before it is not mixed in.
bool PublishedEstimate::another_is_later(double t, const FilterBelief& belief) {
  return std::any_of(belief.occurred.begin(), belief.occurred.end(),
                     [&](double occurred) { return occurred > t && occurred != belief.t; });
}

// Mixes in the case that the last event is later than t.
void PublishedEstimate::mix_last(double t, const FilterBelief& belief) {
  const ImpactEstimate& last = belief.impact;
  const double before = std::max(normal_cdf((last.time - t) / last.time_sigma), least_probability);
  x_ = belief.z.head(2 * at_->n()) - last.jump;
  flight().fly(x_, belief.t, t - belief.t, last.held_before);
  x_ = flight().x() - at_->x;
  at_->x += before * x_;
  at_->X.col(at_->X.cols() - 1) = std::sqrt(before * (1.0 - before)) * x_;
}

void PublishedEstimate::mix_unreported(double t, const FilterBelief& belief) {
  const FilterBelief* present = &belief;
  double longest = std::max(t - belief.t, 0.0);
  for (int i = 0;; ++i) {
    const Unreported event = next(t, longest, *present);
    if (event.contact < 0) return;
    if (i == most_unreported) {
      determined_ = determined_ && event.p < 0.5;
      return;
    }
    const ContactSet held = happen(event, t, *present);
    at_->fly(t, present->z, *present);
    mix(event.p);
    if (event.p < 0.5) return;
    // The next event starts from the mixture.
    if (present == &belief) mixed_ = belief;
    present = &mixed_;
    longest = event.ago;
    const Eigen::Index n2 = 2 * at_->n(), size = at_->size();
    mixed_.t = t;
    mixed_.held = held;
    mixed_.z.head(n2) = at_->x;
    mixed_.S.topRows(n2) = at_->X.leftCols(size);
    mixed_.S.bottomRows(size - n2) = at_->T.leftCols(size);
    fly(t, mixed_);
  }
}

// Returns the unreported event that the mean reached first within `longest` before t. If it has
// reached none, returns the most likely one. The flight is at t before and after the call.
PublishedEstimate::Unreported PublishedEstimate::next(double t, double longest,
                                                      const FilterBelief& belief) {
  Unreported first;
  bool moved = false;
  for (int i = 0; i < flight().contacts(); ++i) {
    const bool opens = contains(belief.held, i);
    if (opens && contains(belief.bursting, i)) continue;
    if (moved) at_->fly(t, belief.z, belief);
    moved = false;
    const auto signal = [&] { return opens ? flight().force(i) : flight().gap(i); };
    const Flight::Gap present = signal();
    const bool falls = present.velocity < 0.0;
    std::optional<Fall> found;
    if (const double back = look_back(present, longest, belief); back > 0.0) {
      moved = true;
      found = latest_fall(t - back, t, [&](double then) {
        flight().fly(belief.z.head(2 * at_->n()), belief.t, then - belief.t, belief.held);
        return signal().g;
      });
    }
    if (!found && !falls) continue;
    // The contact has just been hit, and its gap is not known to be positive yet.
    if (found && !opens && found->t <= t - longest && !(falls && present.g < 0.0)) continue;
    const Fall fall = found.value_or(Fall{t, present.g, t});
    if (moved) at_->fly(fall.lowest_at, belief.z, belief);
    at_->look(i, opens, fall.lowest_at);
    const double s = std::sqrt(at_->phi.squaredNorm() + at_->noise);
    if (!(fall.lowest < certain * s)) continue;
    const double ago = t - fall.t, p = probability(-fall.lowest / s, ago / belief.sigma);
    if (first.contact >= 0 && !(ago > first.ago || (ago == first.ago && p > first.p))) continue;
    first = {i, opens, ago, p};
  }
  if (moved) at_->fly(t, belief.z, belief);
  return first;
}

// How far to look back for the time at which a gap or a force fell below zero, at most `longest`
// [s]; 0 if it cannot have been negative. If it has been positive again for longer than a report is
// late, there was no event.
double PublishedEstimate::look_back(const Flight::Gap& present, double longest,
                                    const FilterBelief& belief) {
  if (present.g < 0.0) return longest;
  const double back = std::min(longest, certain * belief.sigma);
  const double change =
      std::abs(present.velocity) * back + std::abs(present.acceleration) * square(back);
  return present.g < 2.0 * change ? back : 0.0;
}

// Computes the estimate at t with the event, into x_ and X_.
// \return the contacts that are held after the event
ContactSet PublishedEstimate::happen(const Unreported& event, double t,
                                     const FilterBelief& belief) {
  const double then = t - event.ago;
  ContactSet held = belief.held & ~bit(event.contact);
  earlier_.setZero();
  if (event.opens) find_earlier(event.contact, t, event.ago, belief);
  at_->fly(then, belief.z, belief);
  X_ = at_->X.leftCols(X_.cols());
  if (!event.opens) {
    at_->look(event.contact, false, then);
    const double v = at_->of.velocity;
    if (v < 0.0) {
      held = flight().strike(event.contact, false, belief.held);
      flight().carry_through(X_);
      for (Eigen::Index j = 0; j < X_.cols(); ++j) {
        X_.col(j) += (at_->phi[j] / -v) * flight().by_time();
      }
    }
  }
  flight().fly_on(event.ago, held);
  x_ = flight().x();
  flight().turn(event.ago, held, X_);
  return held;
}

// Sets earlier_ to the change of x at t if the contact opens earlier by the deviation of its time.
// The contact force is zero at an opening, so the change is of second order. The deviation includes
// an opening before the last report.
void PublishedEstimate::find_earlier(int contact, double t, double ago,
                                     const FilterBelief& belief) {
  const Eigen::Index n2 = 2 * at_->n();
  const ContactSet others = belief.held & ~bit(contact);
  const auto fly_from = [&](double earlier) {
    flight().fly(belief.z.head(n2), belief.t, t - ago - earlier - belief.t, belief.held);
  };
  at_->look(contact, true, t);
  const double s = std::sqrt(at_->phi.squaredNorm() + at_->noise);
  fly_from(0.0);
  const Flight::Gap there = flight().force(contact);
  const double spread =
      there.velocity < 0.0
          ? std::min(std::hypot(s, std::min(there.g, 0.0)) / -there.velocity, belief.sigma)
          : belief.sigma;
  flight().fly_on(ago, others);
  earlier_ = -flight().x();
  fly_from(spread);
  flight().fly_on(ago + spread, others);
  earlier_ += flight().x();
}

// Mixes the estimate without the event, in at_, and with it, in x_ and X_.
void PublishedEstimate::mix(double p) {
  const Eigen::Index n2 = 2 * at_->n(), size = at_->size(), known = X_.cols();
  const double with = std::sqrt(p), without = std::sqrt(1.0 - p);
  x_ -= at_->x;
  for (Eigen::Index j = 0; j < known; ++j) {
    all_.col(j).head(n2) = without * at_->X.col(j);
    all_.col(j).tail(size - n2) = without * at_->T.col(j);
    all_.col(known + j).head(n2) = with * X_.col(j);
    all_.col(known + j).tail(size - n2) = with * at_->T.col(j);
  }
  all_.rightCols(2).setZero();
  all_.col(2 * known).head(n2) = (with * without) * x_;
  all_.col(2 * known + 1).head(n2) = with * earlier_;
  triangularize(all_, 0, size, 2 * known + 2, reflector_);
  at_->x += p * x_;
  at_->X.setZero();
  at_->T.setZero();
  at_->X.leftCols(size) = all_.topLeftCorner(n2, size);
  at_->T.leftCols(size) = all_.block(n2, 0, size - n2, size);
}

}  // namespace sprag
