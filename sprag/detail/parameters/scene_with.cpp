#include "sprag/detail/parameters/scene_with.h"

#include <algorithm>
#include <memory>

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

void set_harmonics(const Scene& nominal, const Unknown& unknown, double value, Scene& scene) {
  const std::vector<HarmonicGroup> groups = harmonic_groups(nominal);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (unknown.index >= 0 && unknown.index != static_cast<int>(g)) continue;
    const HarmonicGroup& group = groups[g];
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

// Sets the gain or the delay of a record, which forces, supports and the frame share.
void set_record(const Scene& nominal, const Unknown& unknown, double value, Scene& scene) {
  const RecordedInput record = recorded_inputs(nominal)[static_cast<std::size_t>(unknown.index)];
  const SampledInput& present =
      *scene.model.forces[static_cast<std::size_t>(record.forces.front())].input;
  const SampledInput::Settings& settings = present.settings();
  const auto changed = std::make_shared<const SampledInput>(
      with_gain_and_delay(present, unknown.kind == Kind::gain ? value : settings.gain,
                          unknown.kind == Kind::delay ? value : settings.delay));
  replace_input(record, changed, scene);
}

// impact.restitution is a factor if the contacts' restitutions differ.
void set_restitution(const Scene& nominal, int index, double value, Scene& scene) {
  if (index >= 0) {
    scene.model.contacts[static_cast<std::size_t>(index)].restitution = value;
    return;
  }
  const bool one = has_one_restitution(nominal.model);
  for (Contact& contact : scene.model.contacts) {
    contact.restitution = one ? value : value * contact.restitution;
  }
}

// Groups of harmonics, records and restitutions are those of the nominal scene.
void set(const Scene& nominal, const Unknown& unknown, double value, Scene& scene) {
  Model& model = scene.model;
  const auto i = static_cast<std::size_t>(std::max(unknown.index, 0));
  switch (unknown.kind) {
    case Kind::restitution:
      set_restitution(nominal, unknown.index, value, scene);
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
    case Kind::position: {
      Eigen::VectorXd& w = model.contacts[i].w;
      w = moved_direction(*scene.beam, w, scene.positions[i], value);
      scene.positions[i] = value;
      break;
    }
    case Kind::frequency:
    case Kind::phase:
    case Kind::amplitude:
      set_harmonics(nominal, unknown, value, scene);
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
    case Kind::gain:
      set_record(nominal, unknown, value, scene);
      break;
  }
}

}  // namespace

Scene with(const Scene& scene, const std::vector<Unknown>& unknowns,
           const Eigen::VectorXd& values) {
  Scene changed = scene;
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    set(scene, unknowns[k], values[static_cast<Eigen::Index>(k)], changed);
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
