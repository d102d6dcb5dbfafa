// The same machine in other units, which are powers of two of the original ones: all numbers keep
// their digits.
#pragma once

#include <cmath>

#include "sprag/scene.h"

namespace sprag {

/// Exponents: a length x in the original units is x 2^length in the new ones.
struct Units {
  int length = 0, mass = 0, time = 0;

  double of_length(double x) const { return std::ldexp(x, length); }
  double of_mass(double x) const { return std::ldexp(x, mass); }
  double of_time(double x) const { return std::ldexp(x, time); }
  double of_velocity(double x) const { return std::ldexp(x, length - time); }
  double of_force(double x) const { return std::ldexp(x, mass + length - 2 * time); }
  double of_energy(double x) const { return std::ldexp(x, mass + 2 * length - 2 * time); }
};

inline Harmonic in_units(const Units& units, Harmonic of_length) {
  of_length.amplitude = units.of_length(of_length.amplitude);
  of_length.frequency = std::ldexp(of_length.frequency, -units.time);
  return of_length;
}

inline Model in_units(const Units& units, Model model) {
  model.M *= units.of_mass(1.0);
  model.C *= std::ldexp(1.0, units.mass - units.time);
  model.K *= std::ldexp(1.0, units.mass - 2 * units.time);
  for (Force& force : model.forces) {
    force.constant = units.of_force(force.constant);
    force.harmonic.amplitude = units.of_force(force.harmonic.amplitude);
    force.harmonic.frequency = std::ldexp(force.harmonic.frequency, -units.time);
  }
  for (Contact& contact : model.contacts) {
    contact.clearance = units.of_length(contact.clearance);
    contact.motion = in_units(units, contact.motion);
  }
  model.chatter_time = units.of_time(model.chatter_time);
  return model;
}

inline State in_units(const Units& units, State state) {
  state.q *= units.of_length(1.0);
  state.u *= units.of_velocity(1.0);
  return state;
}

inline Scene in_units(const Units& units, Scene scene) {
  scene.model = in_units(units, scene.model);
  scene.beam.reset();
  scene.truth.start = in_units(units, scene.truth.start);
  scene.prior.start = in_units(units, scene.prior.start);
  scene.prior.uncertainty *= units.of_energy(1.0);
  scene.prior.drift = std::ldexp(units.of_energy(scene.prior.drift), -units.time);
  scene.prior.jitter = units.of_time(scene.prior.jitter);
  return scene;
}

}  // namespace sprag
