#include "sprag/identification/machine_family.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "sprag/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;
using Complex = std::complex<double>;

bool nearly_diagonal(const Eigen::MatrixXd& A) {
  const double largest = A.cwiseAbs().maxCoeff();
  Eigen::MatrixXd rest = A;
  rest.diagonal().setZero();
  return rest.cwiseAbs().maxCoeff() <= 1e-12 * largest;
}

void set_steady_response(const Eigen::VectorXcd& F, double scale, Eigen::Index group,
                         Machine& machine) {
  const double Omega = machine.frequencies[group];
  const Complex i_Omega(0.0, Omega);
  if (machine.modal) {
    for (Eigen::Index k = 0; k < F.size(); ++k) {
      machine.response(k, group) =
          F[k] * scale / (machine.K(k, 0) - Omega * Omega + i_Omega * machine.C(k, 0));
    }
    return;
  }
  // In real numbers.
  const Eigen::Index n = F.size();
  MatrixR Z(2 * n, 2 * n), F_parts(2 * n, 1);
  Z.topLeftCorner(n, n) = machine.K.cast<Extended>();
  Z.topLeftCorner(n, n).diagonal().array() -= Omega * Omega;
  Z.bottomLeftCorner(n, n) = Omega * machine.C.cast<Extended>();
  Z.topRightCorner(n, n) = -Z.bottomLeftCorner(n, n);
  Z.bottomRightCorner(n, n) = Z.topLeftCorner(n, n);
  F_parts.topRows(n) = (scale * F.real()).cast<Extended>();
  F_parts.bottomRows(n) = (scale * F.imag()).cast<Extended>();
  const Eigen::MatrixXd parts = solve(Z, F_parts).X.cast<double>();
  machine.response.col(group).real() = parts.topRows(n);
  machine.response.col(group).imag() = parts.bottomRows(n);
}

}  // namespace

MachineFamily::MachineFamily(const Scene& scene, std::vector<Unknown> unknowns)
    : scene_(scene), unknowns_(std::move(unknowns)), groups_(harmonic_groups(scene)) {
  const Model& model = scene_.model;
  const Eigen::Index f = model.coordinates();
  if (scene_.beam) {
    V_ = model.M.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
  } else {
    V_ = eigenpairs(model.K, model.M).vectors;
  }
  V_inverse_ = product(V_.transpose(), model.M);
  C_ = congruent(V_, model.C);
  K_ = congruent(V_, model.K);
  const bool entries = std::any_of(unknowns_.begin(), unknowns_.end(), [](const Unknown& unknown) {
    return unknown.kind == Kind::damping_entry || unknown.kind == Kind::stiffness_entry;
  });
  modal_ = !entries && nearly_diagonal(C_) && nearly_diagonal(K_);
  if (modal_) {
    C_ = C_.diagonal().eval();
    K_ = K_.diagonal().cwiseMax(0.0).eval();
  }
  const auto m = static_cast<Eigen::Index>(model.contacts.size());
  W_.resize(f, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    W_.col(i) = V_.transpose() * model.contacts[static_cast<std::size_t>(i)].w;
  }
  const auto G = static_cast<Eigen::Index>(groups_.size());
  forces_.assign(groups_.size(), Eigen::VectorXcd::Zero(f));
  motions_.setZero(m, G);
  for (Eigen::Index g = 0; g < G; ++g) {
    const HarmonicGroup& group = groups_[static_cast<std::size_t>(g)];
    const auto relative = [&](const Harmonic& harmonic) {
      return std::polar(1.0, harmonic.phase - group.phase) * (harmonic.amplitude / group.amplitude);
    };
    for (const int j : group.forces) {
      const Force& force = model.forces[static_cast<std::size_t>(j)];
      forces_[static_cast<std::size_t>(g)] +=
          relative(force.harmonic) * (V_.transpose() * force.direction);
    }
    for (const int i : group.contacts) {
      motions_(i, g) = relative(model.contacts[static_cast<std::size_t>(i)].motion);
    }
  }
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    if (model.forces[j].constant != 0.0) constants_.push_back(static_cast<int>(j));
  }
  constant_forces_.resize(f, static_cast<Eigen::Index>(constants_.size()));
  for (std::size_t j = 0; j < constants_.size(); ++j) {
    const Force& force = model.forces[static_cast<std::size_t>(constants_[j])];
    constant_forces_.col(static_cast<Eigen::Index>(j)) =
        V_.transpose() * force.direction * force.constant;
  }
}

Eigen::Index MachineFamily::constant_input(int force) const {
  const auto at = std::find(constants_.begin(), constants_.end(), force);
  return 2 * static_cast<Eigen::Index>(groups_.size()) + (at - constants_.begin());
}

Eigen::Index MachineFamily::clearance_input(int contact) const {
  return 2 * static_cast<Eigen::Index>(groups_.size()) + constant_forces_.cols() + contact;
}

Eigen::VectorXd MachineFamily::nominal() const {
  Eigen::VectorXd values(static_cast<Eigen::Index>(unknowns_.size()));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    values[k] = unknowns_[static_cast<std::size_t>(k)].nominal;
  }
  return values;
}

void MachineFamily::set_flow(const Eigen::VectorXd& values, Machine& machine) const {
  machine.modal = modal_;
  machine.C = C_;
  machine.K = K_;
  bool entries = false;
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    switch (unknown.kind) {
      case Kind::damping:
        if (scene_.beam && scene_.beam->damping_ratio.size() == 0) {
          machine.C.setConstant(value / scene_.beam->mass_per_length);
        } else {
          machine.C *= value;
        }
        break;
      case Kind::stiffness: {
        const double factor = value / unknown.nominal;
        machine.K *= factor;
        // A damping ratio stays one.
        if (scene_.beam && scene_.beam->damping_ratio.size() > 0) machine.C *= std::sqrt(factor);
        break;
      }
      case Kind::damping_entry:
      case Kind::stiffness_entry:
        entries = true;
        break;
      default:
        break;
    }
  }
  if (!entries) return;
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    if (unknown.kind != Kind::damping_entry && unknown.kind != Kind::stiffness_entry) continue;
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(n(), n());
    change(unknown.row, unknown.column) = change(unknown.column, unknown.row) =
        values[static_cast<Eigen::Index>(k)] - unknown.nominal;
    (unknown.kind == Kind::damping_entry ? machine.C : machine.K) += congruent(V_, change);
  }
}

Machine MachineFamily::at(const Eigen::VectorXd& values) const {
  Machine machine;
  machine.W = W_;
  machine.jump = W_;
  machine.frequencies.resize(static_cast<Eigen::Index>(groups_.size()));
  machine.response.resize(n(), machine.groups());
  machine.gap_response.resize(contacts(), machine.groups());
  machine.constant_forces = constant_forces_;
  machine.positions.setConstant(contacts(), std::numeric_limits<double>::quiet_NaN());
  at(values, machine);
  return machine;
}

void MachineFamily::set_position(int contact, double position, Machine& machine) const {
  if (machine.positions[contact] == position) return;
  machine.positions[contact] = position;
  const auto i = static_cast<std::size_t>(contact);
  const Eigen::VectorXd& w = scene_.model.contacts[i].w;
  auto column = machine.W.col(contact);
  double side = 0.0;
  for (Eigen::Index k = 0; k < n(); ++k) {
    const int mode = static_cast<int>(k) + 1;
    side += w[k] * mode_shape(mode, scene_.positions[i] / scene_.beam->length);
    // A beam's V is diagonal.
    column[k] = V_(k, k) * mode_shape(mode, position / scene_.beam->length);
  }
  if (side < 0.0) column = -column;
}

void MachineFamily::at(const Eigen::VectorXd& values, Machine& machine) const {
  set_flow(values, machine);
  const Model& model = scene_.model;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    machine.frequencies[static_cast<Eigen::Index>(g)] = groups_[g].frequency;
  }
  double common = std::numeric_limits<double>::quiet_NaN();  // restitution of all contacts
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknown.kind == Kind::restitution && unknown.index < 0) {
      common = value;
    } else if (unknown.kind == Kind::position) {
      set_position(unknown.index, value, machine);
    } else if (unknown.kind == Kind::frequency) {
      machine.frequencies[unknown.index] = value;
    }
  }
  for (int i = 0; i < contacts(); ++i) {
    double restitution =
        std::isnan(common) ? model.contacts[static_cast<std::size_t>(i)].restitution : common;
    for (std::size_t k = 0; k < unknowns_.size(); ++k) {
      if (unknowns_[k].kind == Kind::restitution && unknowns_[k].index == i) {
        restitution = values[static_cast<Eigen::Index>(k)];
      }
    }
    machine.jump.col(i) = machine.W.col(i) * ((1.0 + restitution) / machine.W.col(i).squaredNorm());
  }
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const double ratio = machine.frequencies[g] / groups_[static_cast<std::size_t>(g)].frequency;
    // The acceleration of a frame grows with the frequency, its amplitude does not.
    const bool of_frame = groups_[static_cast<std::size_t>(g)].of_frame;
    set_steady_response(forces_[static_cast<std::size_t>(g)], of_frame ? ratio * ratio : 1.0, g,
                        machine);
    for (Eigen::Index i = 0; i < contacts(); ++i) {
      machine.gap_response(i, g) = motions_(i, g);
      for (Eigen::Index k = 0; k < n(); ++k) {
        machine.gap_response(i, g) += machine.W(k, i) * machine.response(k, g);
      }
    }
  }
}

Eigen::VectorXd MachineFamily::inputs(const Eigen::VectorXd& values) const {
  Eigen::VectorXd of_values(2 * static_cast<Eigen::Index>(groups_.size()) +
                            constant_forces_.cols() + contacts());
  inputs(values, of_values);
  return of_values;
}

void MachineFamily::inputs(const Eigen::VectorXd& values, Eigen::VectorXd& inputs) const {
  const auto G = static_cast<Eigen::Index>(groups_.size());
  // First amplitude and phase of each group.
  for (Eigen::Index g = 0; g < G; ++g) {
    inputs[2 * g] = groups_[static_cast<std::size_t>(g)].amplitude;
    inputs[2 * g + 1] = groups_[static_cast<std::size_t>(g)].phase;
  }
  inputs.segment(2 * G, constant_forces_.cols()).setOnes();
  for (int i = 0; i < contacts(); ++i) {
    inputs[clearance_input(i)] = scene_.model.contacts[static_cast<std::size_t>(i)].clearance;
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknown.kind == Kind::amplitude) inputs[2 * unknown.index] = value;
    if (unknown.kind == Kind::phase) inputs[2 * unknown.index + 1] = value;
    if (unknown.kind == Kind::constant) {
      inputs[constant_input(unknown.index)] = value / unknown.nominal;
    }
    if (unknown.kind == Kind::clearance) inputs[clearance_input(unknown.index)] = value;
  }
  for (Eigen::Index g = 0; g < G; ++g) {
    const double amplitude = inputs[2 * g], phase = inputs[2 * g + 1];
    inputs[2 * g] = amplitude * std::cos(phase);
    inputs[2 * g + 1] = amplitude * std::sin(phase);
  }
}

Eigen::VectorXd MachineFamily::inputs_rate(const Eigen::VectorXd& values, std::size_t k) const {
  const Eigen::VectorXd at = inputs(values);
  Eigen::VectorXd rate = Eigen::VectorXd::Zero(at.size());
  const Unknown& unknown = unknowns_[k];
  const Eigen::Index g = harmonic_input(std::max(unknown.index, 0));
  switch (unknown.kind) {
    case Kind::phase:
      rate[g] = -at[g + 1];
      rate[g + 1] = at[g];
      break;
    case Kind::amplitude: {
      const double amplitude = values[static_cast<Eigen::Index>(k)];
      rate[g] = at[g] / amplitude;
      rate[g + 1] = at[g + 1] / amplitude;
      break;
    }
    case Kind::constant:
      rate[constant_input(unknown.index)] = 1.0 / unknown.nominal;
      break;
    default:
      rate[clearance_input(unknown.index)] = 1.0;
  }
  return rate;
}

Scene MachineFamily::with(const Eigen::VectorXd& values) const {
  Scene scene = scene_;
  const auto harmonics_of = [&](int group, const auto& change) {
    const HarmonicGroup& of = groups_[static_cast<std::size_t>(group)];
    for (const int j : of.forces) change(scene.model.forces[static_cast<std::size_t>(j)].harmonic);
    for (const int i : of.contacts) {
      change(scene.model.contacts[static_cast<std::size_t>(i)].motion);
    }
  };
  Model& model = scene.model;
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    const auto i = static_cast<std::size_t>(std::max(unknown.index, 0));
    switch (unknown.kind) {
      case Kind::restitution:
        for (std::size_t j = 0; j < model.contacts.size(); ++j) {
          if (unknown.index < 0 || j == i) model.contacts[j].restitution = value;
        }
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
        w = moved_direction(*scene_.beam, w, scene_.positions[i], value);
        scene.positions[i] = value;
        break;
      }
      case Kind::frequency: {
        const double ratio = value / groups_[i].frequency;
        harmonics_of(unknown.index, [&](Harmonic& harmonic) { harmonic.frequency = value; });
        if (!groups_[i].of_frame) break;
        for (const int j : groups_[i].forces) {
          model.forces[static_cast<std::size_t>(j)].harmonic.amplitude *= ratio * ratio;
        }
        if (scene.frame) scene.frame->motion.frequency = value;
        break;
      }
      case Kind::phase:
        harmonics_of(unknown.index,
                     [&](Harmonic& harmonic) { harmonic.phase += value - groups_[i].phase; });
        if (groups_[i].of_frame && scene.frame) scene.frame->motion.phase = value;
        break;
      case Kind::amplitude:
        harmonics_of(unknown.index, [&](Harmonic& harmonic) {
          harmonic.amplitude *= value / groups_[i].amplitude;
        });
        if (groups_[i].of_frame && scene.frame) scene.frame->motion.amplitude = value;
        break;
      case Kind::constant:
        model.forces[i].constant = value;
        break;
      case Kind::clearance:
        model.contacts[i].clearance = value;
        break;
    }
  }
  if (scene.beam) {
    model.K = stiffness(*scene.beam).asDiagonal();
    model.C = damping(*scene.beam).asDiagonal();
  }
  return scene;
}

}  // namespace sprag
