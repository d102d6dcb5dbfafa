#include "studies/convergence/study.h"

#include <cstdio>
#include <stdexcept>

#include "sprag/scene_file.h"

namespace sprag::studies {

Field::Field(double value) {
  char number[32];
  std::snprintf(number, sizeof number, "%.6g", value);
  text = number;
}

void Table::add(const std::vector<Field>& fields) {
  std::string line;
  for (const Field& field : fields) line += (line.empty() ? "" : ",") + field.text;
  out_.write(line + "\n");
  out_.flush();
}

void Table::close() {
  if (!out_.close()) throw std::runtime_error(out_.error());
}

Scene paper_beam(int modes) {
  Scene scene = read_scene(SPRAG_SOURCE_DIR "/scenes/paper_beam.toml");
  Beam& beam = *scene.beam;
  beam.modes = modes;
  Model& model = scene.model;
  const Force excitation = model.forces.at(0);
  model.M = mass(beam).asDiagonal();
  model.C = damping(beam).asDiagonal();
  model.K = stiffness(beam).asDiagonal();
  model.forces = {{inertia_direction(beam), 0.0, excitation.harmonic}};
  model.contacts[0].w = mode_shapes(beam, 0.868);
  for (State* state : {&scene.truth.start, &scene.prior.start}) {
    const auto given = state->q.size();
    state->q.conservativeResizeLike(Eigen::VectorXd::Zero(modes));
    state->u.conservativeResizeLike(Eigen::VectorXd::Zero(modes));
    if (state == &scene.truth.start) continue;
    for (Eigen::Index i = given; i < modes; ++i) {
      const double beta = wavenumber(static_cast<int>(i) + 1);
      state->q[i] = 0.5 / (beta * beta);
    }
  }
  return scene;
}

Scene free_beam(int modes) {
  Scene scene = paper_beam(modes);
  scene.model.contacts.clear();
  return scene;
}

}  // namespace sprag::studies
