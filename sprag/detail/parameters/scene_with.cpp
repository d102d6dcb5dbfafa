#include "sprag/detail/parameters/scene_with.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_number.h"

namespace sprag {
namespace {

using Records = std::vector<GainAndDelay>;

// Sets a number of a harmonic, whose group has the nominal value `before`, or of all harmonics:
// then `value` is a factor, or a shift of the phase, and `before` is 1 or 0.
void set_harmonic(std::string_view of, double value, double before, bool accelerates,
                  Harmonic& harmonic) {
  if (of == "phase") {
    harmonic.phase += value - before;
  } else if (of == "amplitude") {
    harmonic.amplitude *= value / before;
  } else {
    const double ratio = value / before;
    harmonic.frequency *= ratio;
    if (accelerates) harmonic.amplitude *= square(ratio);
  }
}

}  // namespace

SceneValues::SceneValues(const Scene& nominal, std::vector<Parameter> unknowns)
    : nominal_(nominal),
      unknowns_(std::move(unknowns)),
      groups_(harmonic_groups(nominal)),
      records_(recorded_inputs(nominal)) {
  const bool one = has_one_restitution(nominal.model);
  std::array<std::vector<std::size_t>, 3> in_order;
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const std::string& key = unknowns_[k].key;
    const std::optional<SceneNumber> number = single_number(key);
    setters_.push_back(number ? setter_of(key, *number) : setter_of_several(key));
    in_order[number ? 1 : one && key.starts_with("impact.") ? 0 : 2].push_back(k);
  }
  for (const auto& of : in_order) in_order_.insert(in_order_.end(), of.begin(), of.end());
}

std::optional<SceneNumber> SceneValues::single_number(const std::string& key) const {
  const auto is_of = [&](const HarmonicGroup& group) { return key.starts_with(group.key + '.'); };
  if (is_of_harmonic(key) && std::any_of(groups_.begin(), groups_.end(), is_of)) {
    return std::nullopt;
  }
  return scene_number(nominal_, key);
}

SceneValues::Setter SceneValues::setter_of(const std::string& key, const SceneNumber& number) {
  if (quantity(key) != "position") {
    return [number](double value, Scene& scene, Records&) { number.set(value, scene); };
  }
  // find_directions() replaces a direction that is not a number.
  return [number](double value, Scene& scene, Records&) {
    if (*number.at(scene, number.i, 0) == value) return;
    number.set(value, scene);
    scene.model.contacts[static_cast<std::size_t>(number.i)].w.setConstant(std::nan(""));
  };
}

SceneValues::Setter SceneValues::setter_of_several(const std::string& key) const {
  const std::string_view of = quantity(key);
  if (of == "restitution") {
    // A factor if the contacts' restitutions differ.
    return [one = has_one_restitution(nominal_.model)](double value, Scene& scene, Records&) {
      for (Contact& contact : scene.model.contacts) {
        contact.restitution = one ? value : value * contact.restitution;
      }
    };
  }
  if (of == "slope") {
    return [](double value, Scene& scene, Records&) {
      for (Contact& contact : scene.model.contacts) contact.curve.slope = value;
    };
  }
  if (of == "C") return [](double value, Scene& scene, Records&) { scene.model.C *= value; };
  if (of == "K") return [](double value, Scene& scene, Records&) { scene.model.K *= value; };
  if (of == "damping_ratio") {
    return [](double value, Scene& scene, Records&) { scene.beam->damping_ratio *= value; };
  }
  for (std::size_t r = 0; r < records_.size(); ++r) {
    if (key == records_[r].key + ".gain") {
      return [r](double value, Scene&, Records& records) { records[r].gain = value; };
    }
    if (key == records_[r].key + ".delay") {
      return [r](double value, Scene&, Records& records) { records[r].delay = value; };
    }
  }
  return setter_of_harmonics(key);
}

SceneValues::Setter SceneValues::setter_of_harmonics(const std::string& key) const {
  const bool all = key.starts_with("excitations.");
  std::vector<HarmonicGroup> groups;
  for (const HarmonicGroup& group : groups_) {
    if (all || key.starts_with(group.key + '.')) groups.push_back(group);
  }
  const std::string of(quantity(key));
  return [of, all, groups](double value, Scene& scene, Records&) {
    for (const HarmonicGroup& group : groups) {
      const double before = of == "phase"       ? (all ? 0.0 : group.phase)
                            : all               ? 1.0
                            : of == "amplitude" ? group.amplitude
                                                : group.frequency;
      const auto set = [&](Harmonic& harmonic, bool accelerates) {
        set_harmonic(of, value, before, accelerates, harmonic);
      };
      for (const int j : group.forces) {
        set(scene.model.forces[static_cast<std::size_t>(j)].harmonic, group.of_frame);
      }
      for (const int i : group.contacts) {
        set(scene.model.contacts[static_cast<std::size_t>(i)].motion, false);
      }
      if (group.of_frame && scene.frame) set(scene.frame->motion, false);
    }
  };
}

std::vector<GainAndDelay> SceneValues::gains_and_delays() const {
  std::vector<GainAndDelay> settings;
  for (const RecordedInput& record : records_) {
    settings.push_back({record.input->settings().gain, record.input->settings().delay});
  }
  return settings;
}

void SceneValues::reset(Scene& scene, std::vector<GainAndDelay>& records) const {
  Model& model = scene.model;
  model.M = nominal_.model.M;
  model.C = nominal_.model.C;
  model.K = nominal_.model.K;
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const Force& force = nominal_.model.forces[j];
    model.forces[j].direction = force.direction;
    model.forces[j].constant = force.constant;
    model.forces[j].harmonic = force.harmonic;
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = nominal_.model.contacts[i];
    if (!scene.beam) model.contacts[i].w = contact.w;
    model.contacts[i].clearance = contact.clearance;
    model.contacts[i].restitution = contact.restitution;
    model.contacts[i].curve.slope = contact.curve.slope;
    model.contacts[i].motion = contact.motion;
    model.contacts[i].input_share = contact.input_share;
  }
  scene.beam = nominal_.beam;
  if (scene.frame) {
    scene.frame->influence = nominal_.frame->influence;
    scene.frame->motion = nominal_.frame->motion;
  }
  scene.clock = nominal_.clock;
  for (std::size_t r = 0; r < records_.size(); ++r) {
    const SampledInput::Settings& settings = records_[r].input->settings();
    records[r] = {settings.gain, settings.delay};
  }
}

void SceneValues::set(const Eigen::VectorXd& values, Scene& scene,
                      std::vector<GainAndDelay>& records) const {
  const double old_length = scene.beam ? scene.beam->length : 0.0;
  reset(scene, records);
  for (const std::size_t k : in_order_) {
    setters_[k](values[static_cast<Eigen::Index>(k)], scene, records);
  }
  update_from(nominal_, scene);
  if (scene.beam) find_directions(old_length, scene);
}

// Mode shapes are costly, so that a contact which has not moved keeps its direction.
void SceneValues::find_directions(double old_length, Scene& scene) const {
  const double length = scene.beam->length, nominal_length = nominal_.beam->length;
  for (std::size_t i = 0; i < scene.positions.size(); ++i) {
    Eigen::VectorXd& w = scene.model.contacts[i].w;
    if (length == old_length && !std::isnan(w[0])) continue;
    const Eigen::VectorXd& nominal = nominal_.model.contacts[i].w;
    double side = 0.0;
    for (Eigen::Index k = 0; k < w.size(); ++k) {
      const int mode = static_cast<int>(k) + 1;
      side += nominal[k] * mode_shape(mode, nominal_.positions[i] / nominal_length);
      w[k] = mode_shape(mode, scene.positions[i] / length);
    }
    if (side < 0.0) w = -w;
  }
}

Scene with(const Scene& scene, const std::vector<Parameter>& unknowns,
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
    changed.model.M = mass(*changed.beam).asDiagonal();
    changed.model.K = stiffness(*changed.beam).asDiagonal();
    changed.model.C = damping(*changed.beam).asDiagonal();
    for (Force& force : changed.model.forces) force.direction = inertia_direction(*changed.beam);
  }
  return changed;
}

Scene with(const Scene& scene, const Parameter& unknown, double value) {
  return with(scene, std::vector{unknown}, Eigen::VectorXd::Constant(1, value));
}

}  // namespace sprag
