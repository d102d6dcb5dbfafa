#include "sprag/detail/parameters/scene_with.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "sprag/detail/mechanics/impact_law.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

// Sets the frequency, phase or amplitude of a harmonic of a group, or of all groups: `value` is
// then a factor, or a shift of the phase.
void set_harmonic(const Unknown& unknown, double value, const HarmonicGroup& group,
                  bool accelerates, Harmonic& harmonic) {
  const bool all = unknown.index < 0;
  if (unknown.kind == Kind::phase) {
    harmonic.phase += all ? value : value - group.phase;
  } else if (unknown.kind == Kind::amplitude) {
    harmonic.amplitude *= all ? value : value / group.amplitude;
  } else {
    const double ratio = all ? value : value / group.frequency;
    harmonic.frequency = ratio * group.frequency;
    if (accelerates) harmonic.amplitude *= ratio * ratio;
  }
}

// K and C of a beam, from those of the nominal one.
void set_matrices(const Scene& nominal, Scene& scene) {
  const Beam& beam = *scene.beam;
  const double mass = beam.mass_per_length * beam.length;
  for (Eigen::Index i = 0; i < scene.model.K.rows(); ++i) {
    double& k = scene.model.K(i, i);
    k = nominal.model.K(i, i) * (beam.bending_stiffness / nominal.beam->bending_stiffness);
    scene.model.C(i, i) = beam.damping_ratio.size() == 0
                              ? beam.damping * beam.length
                              : 2.0 * beam.damping_ratio[i] * std::sqrt(mass * k);
  }
}

}  // namespace

SceneValues::SceneValues(const Scene& nominal, std::vector<Unknown> unknowns)
    : nominal_(nominal),
      unknowns_(std::move(unknowns)),
      groups_(harmonic_groups(nominal)),
      records_(recorded_inputs(nominal)),
      one_restitution_(has_one_restitution(nominal.model)) {}

std::vector<GainAndDelay> SceneValues::gains_and_delays() const {
  std::vector<GainAndDelay> settings;
  for (const RecordedInput& record : records_) {
    settings.push_back({record.input->settings().gain, record.input->settings().delay});
  }
  return settings;
}

void SceneValues::set(const Eigen::VectorXd& values, Scene& scene,
                      std::vector<GainAndDelay>& records) const {
  Model& model = scene.model;
  model.C = nominal_.model.C;
  model.K = nominal_.model.K;
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    model.forces[j].constant = nominal_.model.forces[j].constant;
    model.forces[j].harmonic = nominal_.model.forces[j].harmonic;
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = nominal_.model.contacts[i];
    model.contacts[i].clearance = contact.clearance;
    model.contacts[i].restitution = contact.restitution;
    model.contacts[i].curve.slope = contact.curve.slope;
    model.contacts[i].motion = contact.motion;
  }
  scene.beam = nominal_.beam;
  if (scene.frame) scene.frame->motion = nominal_.frame->motion;
  scene.clock = nominal_.clock;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const SampledInput::Settings& settings = records_[r].input->settings();
    records[r] = {settings.gain, settings.delay};
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    set(unknowns_[k], values[static_cast<Eigen::Index>(k)], scene, records);
  }
  if (scene.beam) set_matrices(nominal_, scene);
}

void SceneValues::set(const Unknown& unknown, double value, Scene& scene,
                      std::vector<GainAndDelay>& records) const {
  Model& model = scene.model;
  const auto i = static_cast<std::size_t>(std::max(unknown.index, 0));
  switch (unknown.kind) {
    case Kind::restitution:
      set_restitution(unknown.index, value, model);
      break;
    case Kind::restitution_slope:
      model.contacts[i].curve.slope = value;
      break;
    case Kind::damping:
      if (scene.beam && scene.beam->damping_ratio.size() == 0) {
        scene.beam->damping = value;
      } else if (scene.beam) {
        scene.beam->damping_ratio *= value;
      } else {
        model.C *= value;
      }
      break;
    case Kind::stiffness:
      if (scene.beam) {
        scene.beam->bending_stiffness = value;
      } else {
        model.K *= value;
      }
      break;
    case Kind::damping_entry:
      model.C(unknown.row, unknown.column) = model.C(unknown.column, unknown.row) = value;
      break;
    case Kind::stiffness_entry:
      model.K(unknown.row, unknown.column) = model.K(unknown.column, unknown.row) = value;
      break;
    case Kind::position:
      set_position(i, value, scene);
      break;
    case Kind::frequency:
    case Kind::phase:
    case Kind::amplitude:
      set_harmonics(unknown, value, scene);
      break;
    case Kind::clock_rate:
      scene.clock.rate = value;
      break;
    case Kind::clock_offset:
      scene.clock.offset = value;
      break;
    case Kind::constant:
      model.forces[i].constant = value;
      break;
    case Kind::clearance:
      model.contacts[i].clearance = value;
      break;
    case Kind::delay:
      records[i].delay = value;
      break;
    case Kind::gain:
      records[i].gain = value;
      break;
  }
}

void SceneValues::set_harmonics(const Unknown& unknown, double value, Scene& scene) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (unknown.index >= 0 && unknown.index != static_cast<int>(g)) continue;
    const HarmonicGroup& group = groups_[g];
    const auto set = [&](Harmonic& harmonic, bool accelerates) {
      set_harmonic(unknown, value, group, accelerates, harmonic);
    };
    for (const int j : group.forces) {
      set(scene.model.forces[static_cast<std::size_t>(j)].harmonic, group.of_frame);
    }
    for (const int i : group.contacts) {
      set(scene.model.contacts[static_cast<std::size_t>(i)].motion, false);
    }
    if (group.of_frame && scene.frame) set(scene.frame->motion, false);
  }
}

// impact.restitution is a factor if the contacts' restitutions differ.
void SceneValues::set_restitution(int index, double value, Model& model) const {
  if (index >= 0) {
    model.contacts[static_cast<std::size_t>(index)].restitution = value;
    return;
  }
  for (Contact& contact : model.contacts) {
    contact.restitution = one_restitution_ ? value : value * contact.restitution;
  }
}

// Mode shapes are costly, so that a contact which is there already keeps its direction.
void SceneValues::set_position(std::size_t i, double value, Scene& scene) const {
  if (scene.positions[i] == value) return;
  scene.positions[i] = value;
  const Eigen::VectorXd& nominal = nominal_.model.contacts[i].w;
  Eigen::VectorXd& w = scene.model.contacts[i].w;
  const double length = scene.beam->length;
  double side = 0.0;
  for (Eigen::Index k = 0; k < w.size(); ++k) {
    const int mode = static_cast<int>(k) + 1;
    side += nominal[k] * mode_shape(mode, nominal_.positions[i] / length);
    w[k] = mode_shape(mode, value / length);
  }
  if (side < 0.0) w = -w;
}

Scene with(const Scene& scene, const std::vector<Unknown>& unknowns,
           const Eigen::VectorXd& values) {
  const SceneValues of_scene(scene, unknowns);
  Scene changed = scene;
  std::vector<GainAndDelay> settings = of_scene.gains_and_delays();
  of_scene.set(values, changed, settings);
  for (std::size_t r = 0; r < settings.size(); ++r) {
    const RecordedInput& record = of_scene.records()[r];
    const SampledInput::Settings& nominal = record.input->settings();
    if (settings[r].gain == nominal.gain && settings[r].delay == nominal.delay) continue;
    replace_input(record,
                  std::make_shared<const SampledInput>(
                      with_gain_and_delay(*record.input, settings[r].gain, settings[r].delay)),
                  changed);
  }
  if (changed.beam) {
    changed.model.K = stiffness(*changed.beam).asDiagonal();
    changed.model.C = damping(*changed.beam).asDiagonal();
  }
  return changed;
}

Scene with(const Scene& scene, const Unknown& unknown, double value) {
  return with(scene, std::vector{unknown}, Eigen::VectorXd::Constant(1, value));
}

}  // namespace sprag
