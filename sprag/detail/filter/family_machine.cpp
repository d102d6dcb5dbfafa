#include "sprag/detail/filter/family_machine.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {
namespace {

using Complex = std::complex<double>;

const Harmonic& harmonic_of(const HarmonicGroup& group, const Model& model) {
  return group.forces.empty()
             ? model.contacts[static_cast<std::size_t>(group.contacts.front())].motion
             : model.forces[static_cast<std::size_t>(group.forces.front())].harmonic;
}

}  // namespace

bool FamilyMachine::moves_like(const FamilyMachine& other) const {
  return C == other.C && K == other.K && W == other.W && D == other.D && shares == other.shares &&
         recorded_forces == other.recorded_forces && constant_force == other.constant_force &&
         frequencies == other.frequencies && forces == other.forces && motions == other.motions;
}

FamilyOfMachines::FamilyOfMachines(const Scene& scene, std::vector<Parameter> unknowns)
    : values_(scene, std::move(unknowns)), groups_(values_.groups()) {
  const Model& model = scene.model;
  // A harmonic with a frequency of its own is a group of its own.
  for (const Parameter& unknown : this->unknowns()) {
    if (quantity(unknown.key) == "frequency" && values_.single_number(unknown.key)) {
      groups_ = harmonic_groups(scene, false);
    }
  }
  if (scene.beam) {
    V_ = model.M.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
  } else {
    V_ = eigenpairs(model.K, model.M).vectors;
  }
  V_transposed_ = V_.transpose();
  const Eigen::Index n = V_.rows(), m = contacts();
  const auto H = std::ssize(groups_), R = std::ssize(records());
  C_ = congruent(V_, model.C);
  K_ = congruent(V_, model.K).diagonal().cwiseMax(0.0).asDiagonal();
  if (is_nearly_diagonal(C_)) C_ = C_.diagonal().eval().asDiagonal();
  directions_.resize(n, std::ssize(model.forces));
  identity_.setIdentity(n, n);
  for (Eigen::MatrixXd* of : {&change_, &product_, &M_}) of->resize(n, n);
  nominal_.scene = scene;
  nominal_.records = values_.gains_and_delays();
  for (Eigen::MatrixXd* of : {&nominal_.W, &nominal_.D, &nominal_.CW, &nominal_.KW}) {
    of->resize(n, m);
  }
  nominal_.G.resize(m, m);
  nominal_.shares.resize(m, R);
  nominal_.recorded_forces.resize(n, R);
  nominal_.clearance.resize(m);
  nominal_.restitution.resize(m);
  nominal_.constant_force.resize(n);
  nominal_.frequencies.resize(H);
  nominal_.forces.resize(n, H);
  nominal_.motions.resize(m, H);
  nominal_.response.setZero(n, H);
  Eigen::VectorXd values(std::ssize(this->unknowns()));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    values[k] = this->unknowns()[static_cast<std::size_t>(k)].nominal;
  }
  set(values, nominal_, nominal_);
  uncoupled_ = C_.isDiagonal(0.0) && !resonates();
  // Which matrices an unknown changes, and whether it couples the modes.
  constexpr double aside = 0.01;  // in coordinates
  FamilyMachine other = nominal_;
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    const Parameter& unknown = this->unknowns()[static_cast<std::size_t>(k)];
    values[k] = unknown.value(aside);
    set(values, nominal_, other);
    values[k] = unknown.nominal;
    changes_flow_.push_back(other.C != nominal_.C || other.K != nominal_.K);
    uncoupled_ = uncoupled_ && is_nearly_diagonal(other.C) && is_nearly_diagonal(other.K);
  }
  set(values, nominal_, nominal_);
}

// Whether a steady response is so much larger than the force that digits would cancel.
bool FamilyOfMachines::resonates() const {
  constexpr double nearly = 1e-4;
  for (const double Omega : nominal_.frequencies) {
    for (Eigen::Index i = 0; i < n(); ++i) {
      const Complex stiffness(K_(i, i) - square(Omega), Omega * C_(i, i));
      if (std::abs(stiffness) < nearly * square(Omega)) return true;
    }
  }
  return false;
}

// The change alone is transformed, so that the nominal matrix keeps the accuracy of its modes.
void FamilyOfMachines::to_modes(const Eigen::MatrixXd& nominal, const Eigen::MatrixXd& of_nominal,
                                const Eigen::MatrixXd& of, Eigen::MatrixXd& in_modes) {
  in_modes = nominal;
  if (of == of_nominal) return;
  if (scene().beam) {
    in_modes.diagonal().array() +=
        V_.diagonal().array().square() * (of.diagonal() - of_nominal.diagonal()).array();
    return;
  }
  change_ = of - of_nominal;
  multiply(V_transposed_, change_, product_);
  multiply_and_add(product_, V_, in_modes);
}

// Multiplies columns by the inverse of M_, whose Cholesky factor it has.
void FamilyOfMachines::divide_by_mass(Eigen::Ref<Eigen::MatrixXd> columns) const {
  for (auto column : columns.colwise()) {
    M_.triangularView<Eigen::Lower>().solveInPlace(column);
    M_.transpose().triangularView<Eigen::Upper>().solveInPlace(column);
  }
}

void FamilyOfMachines::set(const Eigen::VectorXd& values, const FamilyMachine& like,
                           FamilyMachine& machine) {
  const auto number = [](Eigen::Index i) { return static_cast<std::size_t>(i); };
  Scene& changed = machine.scene;
  if (&like != &machine && changed.beam) {
    changed.beam = like.scene.beam;
    changed.positions = like.scene.positions;
    for (Eigen::Index i = 0; i < contacts(); ++i) {
      changed.model.contacts[number(i)].w = like.scene.model.contacts[number(i)].w;
    }
  }
  values_.set(values, changed, machine.records);
  const Model& model = changed.model;
  // The machine's time is (t - shift) / scale.
  const ContactClock& clock = scene().clock;
  const double scale = changed.clock.rate / clock.rate;
  const double shift = (changed.clock.offset - clock.offset) / clock.rate;
  to_modes(C_, scene().model.C, model.C, machine.C);
  to_modes(K_, scene().model.K, model.K, machine.K);
  for (Eigen::Index i = 0; i < contacts(); ++i) {
    const Contact& contact = model.contacts[number(i)];
    machine.W.col(i).noalias() = V_transposed_.lazyProduct(contact.w);
    machine.clearance[i] = contact.clearance + constant_part(contact.motion);
    machine.restitution[i] = contact.restitution;
  }
  for (Eigen::Index j = 0; j < directions_.cols(); ++j) {
    directions_.col(j).noalias() = V_transposed_.lazyProduct(model.forces[number(j)].direction);
  }
  machine.D = machine.W;
  if (model.M != scene().model.M) {
    to_modes(identity_, scene().model.M, model.M, M_);
    if (!factorize(M_)) M_.setConstant(std::nan(""));  // no machine
    for (Eigen::MatrixXd* of : {&machine.C, &machine.K, &machine.D, &directions_}) {
      divide_by_mass(*of);
    }
  }
  machine.clock_scale = scale;
  machine.C /= scale;
  machine.K /= square(scale);
  machine.KW.noalias() = machine.K.transpose().lazyProduct(machine.W);
  machine.CW.noalias() = machine.C.transpose().lazyProduct(machine.W);
  machine.G.noalias() = machine.W.transpose().lazyProduct(machine.D);
  machine.recorded_forces.setZero();
  for (Eigen::Index r = 0; r < machine.shares.cols(); ++r) {
    const RecordedInput& record = records()[number(r)];
    for (const int j : record.forces) machine.recorded_forces.col(r) += directions_.col(j);
    machine.shares.col(r).setZero();
    for (const int i : record.contacts) {
      machine.shares(i, r) = model.contacts[number(i)].input_share;
    }
  }
  machine.constant_force.setZero();
  for (Eigen::Index j = 0; j < directions_.cols(); ++j) {
    const Force& force = model.forces[number(j)];
    const double constant = force.constant + constant_part(force.harmonic);
    machine.constant_force += constant / square(scale) * directions_.col(j);
  }
  machine.forces.setZero();
  machine.motions.setZero();
  for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
    const HarmonicGroup& group = groups_[number(h)];
    const double Omega = harmonic_of(group, model).frequency / scale;
    const Complex turn = std::polar(1.0, -Omega * shift);
    machine.frequencies[h] = Omega;
    for (const int j : group.forces) {
      const Complex force = complex_amplitude(model.forces[number(j)].harmonic) / square(scale);
      machine.forces.col(h) += (turn * force) * directions_.col(j);
    }
    for (const int i : group.contacts) {
      machine.motions(i, h) = turn * complex_amplitude(model.contacts[number(i)].motion);
    }
    for (Eigen::Index i = 0; uncoupled_ && i < n(); ++i) {
      machine.response(i, h) =
          machine.forces(i, h) / Complex(machine.K(i, i) - square(Omega), Omega * machine.C(i, i));
    }
  }
}

}  // namespace sprag
