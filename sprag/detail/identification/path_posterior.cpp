#include "sprag/detail/identification/path_posterior.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/filter/event_filter.h"
#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/filter/triangularize.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Diffuse prior: deviation of the state in units of the largest value on the path, and of c in
// units of the unknown's range.
constexpr double diffuse = 3.0;

// Largest |x| on the path, by entry.
Eigen::VectorXd largest(FamilyFlight& flight, const EventFit& fit) {
  Eigen::VectorXd sizes = Eigen::VectorXd::Zero(2 * flight.n());
  flight.set(fit.point.c, false);
  for (std::size_t s = 0; s < fit.stretches.size(); ++s) {
    const FitStretch& stretch = fit.stretches[s];
    PathPoint at{fit.point.starts[s], stretch.start, stretch.held};
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      pass(flight, stretch.events[k], fit.point.times[s][k], at);
      sizes = sizes.cwiseMax(at.x.cwiseAbs());
    }
  }
  return sizes;
}

// Updates the belief by an impact that is reported at t and that the path has at `when`. `on` is
// the path before the impact, and on return the path after it.
void take(int contact, double t, double when, LinearizedFlight& at, Eigen::VectorXd& on,
          FilterBelief& belief) {
  Flight& flight = at.flight();
  const Eigen::Index n2 = 2 * at.n(), P = at.unknowns(), last = at.X.cols() - 1;
  at.spread(belief, when - belief.t);
  at.fly(when, on, belief, false);
  at.look(contact, false, when);
  belief.length = std::max(belief.length, at.of.length);
  const double of_time = -at.of.velocity * belief.sigma;
  at.phi[last] = of_time;
  const Eigen::VectorXd offset = belief.z - on;
  at.carry(offset);
  Eigen::VectorXd x = at.dx, c = offset.tail(P);
  const double residual =
      at.of.g + at.of_g.dot(at.dx) + at.by_c.dot(c) + at.of.velocity * (t - when);
  const double variance = at.phi.squaredNorm() + at.noise;
  const double gain = belief.sigma * of_time / variance;
  const double shrink = 1.0 / (1.0 + std::sqrt(at.noise / variance));
  at.measure(residual, at.noise, x, c);
  const double off = -gain * residual - (t - when);
  flight.set(on.tail(P), true);
  flight.fly(at.x, when, 0.0, 0);
  flight.strike(contact, false, 0);
  flight.carry_through(at.X);
  FilterBelief::Rows all(at.size(), last + 1);
  for (Eigen::Index j = 0; j <= last; ++j) {
    const double of_tau = (j == last ? belief.sigma : 0.0) - gain * shrink * at.phi[j];
    all.col(j) << at.X.col(j) + flight.by_unknowns() * at.T.col(j) - of_tau * flight.by_time(),
        at.T.col(j);
  }
  flight.carry_through(x);
  x += flight.by_unknowns() * c - off * flight.by_time();
  on.head(n2) = flight.x();
  belief.z = on;
  belief.z.head(n2) += x;
  belief.z.tail(P) += c;
  Eigen::VectorXd scratch(all.cols());
  triangularize(all, 0, at.size(), all.cols(), scratch);
  belief.S = all.topLeftCorner(at.size(), at.size());
  belief.t = when;
  belief.reported[contact] = t;
  belief.occurred[contact] = when;
}

}  // namespace

FilterBelief path_posterior(const SceneValues& family, const FilterModel& model,
                            const EventFit& fit, double sigma) {
  FamilyFlight flight(family.nominal(), family.unknowns());
  EventFilter filter(flight, model);
  LinearizedFlight at(flight, filter.model());
  const Eigen::Index n2 = 2 * flight.n();
  const Eigen::VectorXd& c = fit.point.c;
  FilterBelief belief = filter.no_belief();
  for (Eigen::Index k = 0; k < c.size(); ++k) {
    const Parameter& unknown = family.unknowns()[static_cast<std::size_t>(k)];
    belief.S(n2 + k, n2 + k) = unknown.logarithmic ? diffuse * unknown.within : 1.0;
  }
  belief.z.tail(c.size()) = c;
  belief.t = fit.stretches.front().start;
  const Eigen::MatrixXd wide = (diffuse * largest(flight, fit)).asDiagonal();
  Eigen::VectorXd on(at.size());
  for (std::size_t s = 0; s < fit.stretches.size(); ++s) {
    const FitStretch& stretch = fit.stretches[s];
    on << fit.point.starts[s], c;
    double t = stretch.start;
    ContactSet held = stretch.held;
    const auto restart = [&] {
      belief.sigma = sigma;
      filter.restart(t, on.head(n2), wide, 0, belief);
    };
    if (held == 0) restart();
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      const FitEvent& event = stretch.events[k];
      const double when = fit.point.times[s][k];
      if (held == 0 && event.kind == ContactEventKind::pulse) {
        // The time of a lost impact is a guess, with the flight's duration as its deviation.
        belief.sigma = event.timed ? sigma : when - belief.t;
        take(event.contact, event.t, when, at, on, belief);
        t = when;
        continue;
      }
      PathPoint point{on.head(n2), t, held};
      flight.set(c, false);
      pass(flight, event, when, point);
      on.head(n2) = point.x;
      t = when;
      held = point.held;
      if (held == 0) restart();
    }
  }
  belief.sigma = sigma;
  return belief;
}

}  // namespace sprag
