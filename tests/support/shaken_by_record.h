// A scene with one harmonic excitation, shaken by a record of that harmonic instead.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "sprag/scene.h"

namespace sprag::test {

/// The record is the displacement cos(frequency t) with a sample every `dt` [s]. Forces and
/// supports keep their motion up to the interpolation error. The first force must have the
/// harmonic.
inline Scene shaken_by_record(Scene scene, double dt, double duration) {
  const Harmonic of = scene.model.forces[0].harmonic;
  std::vector<double> t, e;
  for (int k = -8; dt * k < duration; ++k) {
    t.push_back(dt * k);
    e.push_back(std::cos(of.frequency * t.back() + of.phase));
  }
  const auto record = std::make_shared<const SampledInput>(
      t, e, SampledInput::Settings{.interpolation = Interpolation::spline, .displacement = true});
  for (Force& force : scene.model.forces) {
    force.direction *= -force.harmonic.amplitude / (of.frequency * of.frequency);
    force.harmonic = {};
    force.input = record;
  }
  for (Contact& contact : scene.model.contacts) {
    if (contact.motion.amplitude == 0.0) continue;
    contact.input_share = contact.motion.amplitude;
    contact.motion = {};
    contact.input = record;
  }
  return scene;
}

}  // namespace sprag::test
