#include "tests/support/random_model.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {

Harmonic random_harmonic(Random& random) {
  return {random.uniform(-1, 1), random.uniform(1.0, 12.0), random.phase()};
}

Model random_machine(Random& random, Structure structure, Eigen::Index f) {
  using Matrix = Eigen::MatrixXd;
  const auto positive = [&](double low, double high) {
    Eigen::VectorXd values(f);
    for (double& value : values) value = random.log_uniform(low, high);
    return values;
  };
  const auto symmetric = [](const Matrix& A) { return Matrix(0.5 * (A + A.transpose())); };
  Model model;
  model.M = random.positive_definite(f, 0.5, 3.0);
  // Columns of T are M-orthonormal: T^-T D T^-1 has the modes T.
  const Matrix L = CholeskyFactor(model.M).L();
  const Matrix T_inverse = random.orthogonal(f).transpose() * L.transpose();
  const auto with_modes = [&](const Eigen::VectorXd& values) {
    return symmetric(T_inverse.transpose() * values.asDiagonal() * T_inverse);
  };
  const double k = random.log_uniform(0.5, 100.0);
  switch (structure) {
    case Structure::diagonal:
      model.M = positive(0.3, 3.0).asDiagonal();
      model.C = positive(0.01, 20.0).asDiagonal();
      model.K = positive(0.1, 300.0).asDiagonal();
      if (random.chance(0.3)) model.C(0, 0) = 0.0;
      if (random.chance(0.3)) model.K(0, 0) = 0.0;
      break;
    case Structure::rayleigh:
      model.K = with_modes(positive(0.1, 300.0));
      model.C = random.uniform(0.0, 1.0) * model.M + random.uniform(0.0, 0.2) * model.K;
      break;
    case Structure::simultaneous:
      model.K = with_modes(positive(0.1, 300.0));
      model.C = with_modes(positive(0.01, 20.0));
      break;
    case Structure::coupled:
      model.K = with_modes(positive(0.1, 300.0));
      model.C = random.positive_definite(f, 0.05, 4.0);
      break;
    case Structure::repeated:
      model.K = k * model.M;
      model.C = random.positive_definite(f, 0.05, 4.0);
      break;
    case Structure::repeated_pair: {
      Eigen::VectorXd values = positive(0.1, 300.0);
      if (f > 1) values[1] = values[0];
      model.K = with_modes(values);
      model.C = random.positive_definite(f, 0.05, 4.0);
      break;
    }
    case Structure::all_equal:
      model.K = k * model.M;
      model.C = random.uniform(0.0, 3.0) * model.M;
      break;
    case Structure::no_stiffness:
      model.K = Matrix::Zero(f, f);
      model.C = random.positive_definite(f, 0.05, 4.0);
      break;
    case Structure::no_stiffness_no_damping:
      model.K = Matrix::Zero(f, f);
      model.C = Matrix::Zero(f, f);
      break;
    case Structure::strongly_damped:
      model.K = with_modes(positive(0.1, 2.0));
      model.C = random.positive_definite(f, 15.0, 30.0);
      break;
  }
  return model;
}

void add_forces(Random& random, Model& model, int count) {
  for (int i = 0; i < count; ++i) {
    model.forces.push_back(
        {random.vector(model.coordinates()), random.uniform(-3, 3), random_harmonic(random)});
  }
}

void add_contacts(Random& random, Model& model, int count) {
  for (int i = 0; i < count; ++i) {
    Contact contact;
    const auto close_to_another = [&] {
      for (const Contact& other : model.contacts) {
        if (std::abs(contact.w.dot(other.w)) > 0.95) return true;
      }
      return false;
    };
    do {
      contact.w = random.vector(model.coordinates()).normalized();
    } while (model.coordinates() > 1 && close_to_another());
    contact.clearance = random.uniform(-1, 1);
    if (random.chance(0.7)) contact.motion = random_harmonic(random);
    contact.restitution = random.uniform(0, 1);
    model.contacts.push_back(contact);
  }
}

State random_state(Random& random, const Model& model) {
  State state;
  state.q = random.vector(model.coordinates());
  state.u = 3.0 * random.vector(model.coordinates());
  return state;
}

ImpactingMachine random_impacting_machine(Random& random) {
  ImpactingMachine machine;
  Model& model = machine.model;
  const int f = random.integer(1, 6);
  const int m = random.integer(1, std::min(f, 3));
  const auto structure = static_cast<std::size_t>(random.integer(0, int{structures.size()} - 1));
  model = random_machine(random, structures.at(structure), f);
  add_forces(random, model, random.integer(0, 2));
  add_contacts(random, model, m);
  machine.start = random_state(random, model);
  const double restitution = random.chance(0.1) ? 0.0 : random.uniform(0, 1);
  for (Contact& contact : model.contacts) {
    contact.restitution = restitution;
    contact.clearance -= gap(contact, machine.start.q, 0.0) - random.uniform(0.0, 0.3);
    model.forces.push_back({-contact.w, random.uniform(0, 5), {}});
  }
  if (m == 1 && random.chance(0.5)) model.law = ImpactLaw::newton;
  return machine;
}

}  // namespace sprag
