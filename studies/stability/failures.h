// Failures of methods for impacting machines, each compared with the result of Sprag. Only this
// study and its tests use the failing variants; no program does.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sprag::stability {

struct Curve {
  std::string name;
  std::vector<double> x, y;

  void add(double x_value, double y_value) {
    x.push_back(x_value);
    y.push_back(y_value);
  }
};

/// Gap velocity gamma_2 [m/s] against time [s] at a closed clutch, while contact 1 pulses: by
/// Newton's law, which allows gamma+ = -epsilon gamma- < 0, and by Poisson's.
std::vector<Curve> newton_after_a_closed_clutch();

/// Largest growth of V at one impact of a two-contact machine, over `pairs` random pairs of states,
/// against epsilon_1 - epsilon_2 with mean 1/2: Newton, Poisson. Fixed seed.
std::vector<Curve> unlike_restitution(int pairs);

/// Criterion of monotone Newton impacts at that difference: smallest eigenvalue of D G + G D.
double newton_criterion(double difference);

/// V [J] against t [s] on the paper's beam, with its damping and with C = 0.
std::vector<Curve> no_damping(double T);

/// V [J] against t [s] with the master held in contact until its release: V stalls, then falls. The
/// third curve is the static remainder 1/2 |c|_K^2 of (17) during the contact.
std::vector<Curve> persistent_contact(double T);

/// Number of events against t [s] of the bouncing ball: infinitely many impacts before the
/// accumulation point (at most `limit` are listed), and with completed chatter.
std::vector<Curve> event_storm(int limit);

/// Share of missed grazing contacts of `scenes` random motions of three modes, 1e-9 to 1e-2 deep,
/// against the tick [s]: by a sign check at the ticks, and by the event search. Fixed seed.
std::vector<Curve> missed_touches(int scenes);

/// Work [J] of the contact's impulse in one Moreau-Jean step of a unit mass pressed on a stop, gap
/// <= 0, against gamma_k [m/s]: with the contact active by its gap alone, and active only during
/// the approach.
std::vector<Curve> gap_activation();

/// log10 of the energy of one undamped oscillator against steps at omega h = 2.1: explicit Euler,
/// theta = 0.4, theta = 1/2, exact flow.
std::vector<Curve> step_limits();

}  // namespace sprag::stability
