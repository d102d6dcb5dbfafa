#include "sprag/detail/identification/bounces.h"

#include <cmath>
#include <optional>
#include <utility>

#include "sprag/detail/identification/free_flight.h"

namespace sprag {
namespace {

constexpr double shortest = 0.1;  // shortest flight of a bounce, in jitters

// Duration of the flight from an impact at t to the next impact of the contact, near `expected`;
// nothing if there is none.
std::optional<double> flight_of_bounce(const FreeFlight& flight, ContactSet held, int contact,
                                       double t, const Eigen::VectorXd& y, const Eigen::VectorXd& u,
                                       double expected) {
  constexpr int most_steps = 30;
  constexpr double near = 1e-5;  // relative; the gaps of small bounces have few digits
  const double gap = flight.gap(contact, y, t);
  const double gamma = flight.gap_velocity(contact, u, t);
  double tau = expected;
  for (int i = 0; i < most_steps && tau > 0.0; ++i) {
    Eigen::VectorXd y_next = y, u_next = u;
    flight.move(held, t, tau, y_next, u_next);
    // Parabola through both gaps with the velocity of the first.
    const double half = (flight.gap(contact, y_next, t + tau) - gap - gamma * tau) / (tau * tau);
    const double root = gamma * gamma - 4.0 * half * gap;
    if (!(half < 0.0) || !(gamma > 0.0) || !(root >= 0.0)) return std::nullopt;
    const double next = -(gamma + std::sqrt(root)) / (2.0 * half);
    if (std::abs(next - tau) <= near * tau) return next;
    tau = next;
  }
  return std::nullopt;
}

struct Walk {
  const FreeFlight& flight;
  double t;
  ContactSet held;
  Eigen::VectorXd y, u;

  void move(double to, ContactSet staying) {
    flight.move(held, t, to - t, y, u);
    t = to;
    held = staying;
  }
  void hit(double to, int contact, ContactSet staying) {
    move(to, staying);
    flight.hit(contact, to, u, staying);
  }
};

// Returns the bounces before an impact, on the path from `walk`. `passed` receives the remaining
// passages. Empty if the path has no such bounces.
std::vector<Impact> bounces_before(Walk walk, const Impact& impact, double least,
                                   std::vector<Passage>& passed) {
  const std::vector<Passage>& all = impact.passed;
  std::vector<Impact> bounces;
  double measured = walk.t;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const int contact = all[i].contact;
    if (contact < 0) {
      if (all[i].t < walk.t) return {};
      walk.move(all[i].t, all[i].staying);
      passed.push_back(all[i]);
      measured = walk.t;
      continue;
    }
    const double expected = std::max(all[i].t - measured, least);
    measured = all[i].t;
    const auto tau =
        flight_of_bounce(walk.flight, walk.held, contact, walk.t, walk.y, walk.u, expected);
    if (!tau) return {};
    // The path skips the bounces after one that is too short.
    if (*tau < least) {
      while (i + 1 < all.size() && all[i + 1].contact == contact &&
             !contains(all[i].staying, contact)) {
        ++i;
      }
    }
    bounces.push_back({walk.t + *tau, contact, false, impact.event, walk.held, all[i].staying,
                       std::exchange(passed, {})});
    walk.hit(bounces.back().t, contact, all[i].staying);
  }
  if (impact.t < walk.t) return {};
  return bounces;
}

}  // namespace

void take_bounces(const MachineFamily& family, double jitter, Stretches& stretches,
                  Likelihood& path) {
  const Machine machine = family.at(path.values);
  const FreeFlight flight(machine, family.inputs(path.values));
  const Eigen::Index n = family.n();
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    Stretch& led = path.path[s];
    Eigen::VectorXd y = path.x0[s].head(n), u = path.x0[s].tail(n);
    std::vector<Impact> of_path, of_measured;
    for (std::size_t k = 0; k < led.size(); ++k) {
      const Impact& impact = led.impacts[k];
      std::vector<Passage> passed;
      const Walk walk = k > 0 ? Walk{flight, led.impacts[k - 1].t, led.impacts[k - 1].staying, y, u}
                              : Walk{flight, led.start, led.held, y, u};
      const std::vector<Impact> bounces = bounces_before(walk, impact, shortest * jitter, passed);
      for (std::vector<Impact>* const of : {&of_path, &of_measured}) {
        of->insert(of->end(), bounces.begin(), bounces.end());
      }
      of_path.push_back(impact);
      of_measured.push_back(stretches[s].impacts[k]);
      if (!bounces.empty()) of_path.back().passed = of_measured.back().passed = passed;
      fly(flight, led, k, y, u, [](double, double, ContactSet) {});
      flight.hit(impact.contact, impact.t, u, impact.staying);
    }
    led.impacts = std::move(of_path);
    stretches[s].impacts = std::move(of_measured);
  }
}

}  // namespace sprag
