#include "studies/robustness/machines.h"

#include <algorithm>
#include <cmath>

#include "sprag/estimation/parameters.h"
#include "sprag/files/scene_file.h"
#include "studies/robustness/random.h"

namespace sprag::robustness {
namespace {

Quantity quantity(Wrong wrong) {
  switch (wrong) {
    case Wrong::restitution:
      return Quantity::restitution;
    case Wrong::damping:
      return Quantity::damping;
    case Wrong::stiffness:
      return Quantity::stiffness;
    case Wrong::amplitude:
      return Quantity::amplitude;
    case Wrong::phase:
      return Quantity::phase;
    default:
      return Quantity::clearance;
  }
}

}  // namespace

Scene read_paper_beam(const std::string& file) {
  Scene scene = read_scene(file);
  if (!scene.beam || scene.model.contacts.size() != 1 ||
      scene.model.contacts[0].w != mode_shapes(*scene.beam, contact_position)) {
    throw SceneError(file, "the studies need a beam with one contact, below, at 0.868");
  }
  return scene;
}

Scene with_modes(const Scene& scene, int modes) {
  Scene other = scene;
  Beam& beam = *other.beam;
  beam.modes = modes;
  Model& model = other.model;
  model.M = mass(beam).asDiagonal();
  model.C = damping(beam).asDiagonal();
  model.K = stiffness(beam).asDiagonal();
  for (Force& force : model.forces) force.direction = inertia_direction(beam);
  for (Contact& contact : model.contacts) contact.w = mode_shapes(beam, contact_position);
  for (Eigen::VectorXd* x :
       {&other.master.q, &other.master.u, &other.replica.q, &other.replica.u}) {
    x->conservativeResizeLike(Eigen::VectorXd::Zero(modes));
  }
  if (scene.uncertainty.size() > 0) {
    other.uncertainty.setConstant(modes, scene.uncertainty.sum() / modes);
  }
  return other;
}

Scene with_random_start(Scene scene, std::uint64_t seed) {
  constexpr double of_first = 0.02;
  Random random(seed);
  const Eigen::VectorXd mean = scene.master.q;
  const Eigen::VectorXd K = scene.model.K.diagonal();
  do {
    for (Eigen::Index i = 0; i < std::min<Eigen::Index>(3, mean.size()); ++i) {
      scene.master.q[i] = mean[i] + of_first * std::sqrt(K[0] / K[i]) * random.normal();
    }
  } while (!(gap(scene.model.contacts[0], scene.master.q, 0.0) > 0.0));
  return scene;
}

Scene with_wrong(Scene scene, Wrong wrong, double deviation) {
  if (wrong == Wrong::position) {
    scene.model.contacts[0].w = mode_shapes(*scene.beam, contact_position * (1.0 + deviation));
    return scene;
  }
  const auto parameters = parameters_of(scene, 0.0);
  const Parameter& parameter =
      *std::find_if(parameters.begin(), parameters.end(),
                    [&](const Parameter& one) { return one.quantity == quantity(wrong); });
  const bool absolute = wrong == Wrong::clearance || wrong == Wrong::phase;
  scene.model =
      with(scene, parameter, parameter.nominal + deviation * (absolute ? 1.0 : parameter.nominal));
  return scene;
}

}  // namespace sprag::robustness
