#include "sprag/detail/identification/machine_family.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;
using Complex = std::complex<double>;

}  // namespace

void set_steady_response(const Machine& machine, double Omega, Eigen::Ref<Eigen::MatrixXcd> F) {
  if (machine.modal) {
    for (Eigen::Index k = 0; k < F.rows(); ++k) {
      F.row(k) /= Complex(machine.K(k, 0) - Omega * Omega, Omega * machine.C(k, 0));
    }
    return;
  }
  MatrixCR Z(machine.n(), machine.n());
  Z.real() = machine.K.cast<Extended>();
  Z.real().diagonal().array() -= Omega * Omega;
  Z.imag() = Omega * machine.C.cast<Extended>();
  F = solve(Z, MatrixCR(F.cast<std::complex<Extended>>())).cast<Complex>();
}

GapMotion recorded_gap(const Machine& machine, int contact, Eigen::Index r, double t) {
  RecordedMotion motion;
  (*machine.recorded)[static_cast<std::size_t>(r)].at(t - machine.delays[r], motion);
  const auto w = machine.W.col(contact);
  const double share = machine.shares(contact, r);
  return {w.dot(motion.y) + share * motion.input[0], w.dot(motion.u) + share * motion.input[1],
          w.dot(motion.rate) + share * motion.input[2]};
}

void add_recorded_motion(const Machine& machine, const Eigen::VectorXd& inputs, double t,
                         Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::VectorXd> u) {
  RecordedMotion motion;
  for (Eigen::Index r = 0; r < machine.records(); ++r) {
    (*machine.recorded)[static_cast<std::size_t>(r)].at(t - machine.delays[r], motion);
    const double gain = inputs[2 * machine.groups() + r];
    y += gain * motion.y;
    u += gain * motion.u;
  }
}

void add_driven_motion(const Machine& machine, const Eigen::VectorXd& inputs, double t,
                       Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::VectorXd> u) {
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const std::complex<double> z(inputs[2 * g], inputs[2 * g + 1]);
    const std::complex<double> turn = z * std::polar(1.0, machine.frequencies[g] * t);
    y += (machine.response.col(g) * turn).real();
    u += (machine.response.col(g) * (turn * std::complex<double>(0.0, machine.frequencies[g])))
             .real();
  }
  add_recorded_motion(machine, inputs, t, y, u);
}

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
  modal_ = !entries && is_nearly_diagonal(C_) && is_nearly_diagonal(K_);
  if (modal_) {
    C_ = C_.diagonal().eval();
    K_ = K_.diagonal().cwiseMax(0.0).eval();
  }
  restitutions_differ_ = !has_one_restitution(model);
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
  add_records();
}

void MachineFamily::add_records() {
  records_ = recorded_inputs(scene_);
  const Model& model = scene_.model;
  const auto R = static_cast<Eigen::Index>(records_.size());
  recorded_forces_.setZero(n(), R);
  recorded_motions_.setZero(contacts(), R);
  for (Eigen::Index r = 0; r < R; ++r) {
    const RecordedInput& record = records_[static_cast<std::size_t>(r)];
    for (const int j : record.forces) {
      recorded_forces_.col(r) +=
          V_.transpose() * model.forces[static_cast<std::size_t>(j)].direction;
    }
    for (const int i : record.contacts) {
      recorded_motions_(i, r) = model.contacts[static_cast<std::size_t>(i)].input_share;
    }
    longest_delay_ = std::max(longest_delay_, record.input->settings().delay);
  }
  for (const Unknown& unknown : unknowns_) {
    if (unknown.kind != Kind::delay) continue;
    longest_delay_ = std::max(longest_delay_, unknown.value(unknown.highest()));
  }
}

MachineFamily::Responses MachineFamily::responses_of(const Machine& machine) const {
  if (records_.empty()) return nullptr;
  constexpr std::size_t most = 16;
  for (const Tabulated& table : tabulated_) {
    if (table.C == machine.C && table.K == machine.K) return table.responses;
  }
  for (std::size_t r = raw_.size(); r < records_.size(); ++r) {
    raw_.push_back(with_gain_and_delay(*records_[r].input, 1.0, 0.0));
  }
  std::vector<RecordedResponse> responses;
  for (std::size_t r = 0; r < raw_.size(); ++r) {
    responses.emplace_back(raw_[r], machine.modal, machine.C, machine.K,
                           recorded_forces_.col(static_cast<Eigen::Index>(r)), longest_delay_);
  }
  if (tabulated_.size() == most) tabulated_.erase(tabulated_.begin());
  tabulated_.push_back(
      {machine.C, machine.K,
       std::make_shared<const std::vector<RecordedResponse>>(std::move(responses))});
  return tabulated_.back().responses;
}

void MachineFamily::set_delays(const Eigen::VectorXd& values, Machine& machine) const {
  for (std::size_t r = 0; r < records_.size(); ++r) {
    machine.delays[static_cast<Eigen::Index>(r)] = records_[r].input->settings().delay;
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    if (unknowns_[k].kind != Kind::delay) continue;
    machine.delays[unknowns_[k].index] = values[static_cast<Eigen::Index>(k)];
  }
}

Eigen::Index MachineFamily::constant_input(int force) const {
  const auto at = std::find(constants_.begin(), constants_.end(), force);
  return driving() + (at - constants_.begin());
}

Eigen::Index MachineFamily::clearance_input(int contact) const {
  return driving() + constant_forces_.cols() + contact;
}

Eigen::VectorXd MachineFamily::nominal() const {
  Eigen::VectorXd values(static_cast<Eigen::Index>(unknowns_.size()));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    values[k] = unknowns_[static_cast<std::size_t>(k)].nominal;
  }
  return values;
}

double MachineFamily::clock_scale(const Eigen::VectorXd& values) const {
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    if (unknowns_[k].kind != Kind::clock_rate) continue;
    return values[static_cast<Eigen::Index>(k)] / unknowns_[k].nominal;
  }
  return 1.0;
}

double MachineFamily::clock_shift(const Eigen::VectorXd& values) const {
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    if (unknowns_[k].kind != Kind::clock_offset) continue;
    return (values[static_cast<Eigen::Index>(k)] - unknowns_[k].nominal) / scene_.clock.rate;
  }
  return 0.0;
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
        // A specified damping ratio does not change with the stiffness.
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
  for (std::size_t k = 0; entries && k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    if (unknown.kind != Kind::damping_entry && unknown.kind != Kind::stiffness_entry) continue;
    Eigen::MatrixXd change = Eigen::MatrixXd::Zero(n(), n());
    change(unknown.row, unknown.column) = change(unknown.column, unknown.row) =
        values[static_cast<Eigen::Index>(k)] - unknown.nominal;
    (unknown.kind == Kind::damping_entry ? machine.C : machine.K) += congruent(V_, change);
  }
  const double scale = clock_scale(values);
  if (scale == 1.0) return;
  machine.C /= scale;
  machine.K /= square(scale);
}

Machine MachineFamily::at(const Eigen::VectorXd& values) const {
  Machine machine = without_responses(values);
  machine.recorded = responses_of(machine);
  return machine;
}

Machine MachineFamily::without_responses(const Eigen::VectorXd& values) const {
  Machine machine;
  machine.W = W_;
  machine.jump = W_;
  machine.frequencies.resize(static_cast<Eigen::Index>(groups_.size()));
  machine.response.resize(n(), machine.groups());
  machine.gap_response.resize(contacts(), machine.groups());
  machine.constant_forces = constant_forces_;
  machine.positions.setConstant(contacts(), std::numeric_limits<double>::quiet_NaN());
  machine.delays.resize(static_cast<Eigen::Index>(records_.size()));
  machine.recorded_forces = recorded_forces_;
  machine.shares = recorded_motions_;
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
  set_delays(values, machine);
  const Model& model = scene_.model;
  frequencies(values, machine.frequencies);
  double common = std::numeric_limits<double>::quiet_NaN();  // restitution of all contacts
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknown.kind == Kind::restitution && unknown.index < 0) {
      common = value;
    } else if (unknown.kind == Kind::position) {
      set_position(unknown.index, value, machine);
    }
  }
  for (int i = 0; i < contacts(); ++i) {
    double restitution = model.contacts[static_cast<std::size_t>(i)].restitution;
    if (!std::isnan(common)) restitution = restitutions_differ_ ? common * restitution : common;
    for (std::size_t k = 0; k < unknowns_.size(); ++k) {
      if (unknowns_[k].kind == Kind::restitution && unknowns_[k].index == i) {
        restitution = values[static_cast<Eigen::Index>(k)];
      }
    }
    machine.jump.col(i) = machine.W.col(i) * ((1.0 + restitution) / machine.W.col(i).squaredNorm());
  }
  const double scale = clock_scale(values);
  machine.constant_forces = constant_forces_ / square(scale);
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const double ratio = machine.frequencies[g] / groups_[static_cast<std::size_t>(g)].frequency;
    // The amplitude of a frame's motion is fixed, so its acceleration grows with the frequency
    // squared.
    const bool of_frame = groups_[static_cast<std::size_t>(g)].of_frame;
    machine.response.col(g) =
        forces_[static_cast<std::size_t>(g)] * (of_frame ? ratio * ratio : 1.0 / square(scale));
    set_steady_response(machine, machine.frequencies[g], machine.response.col(g));
    for (Eigen::Index i = 0; i < contacts(); ++i) {
      machine.gap_response(i, g) = motions_(i, g);
      for (Eigen::Index k = 0; k < n(); ++k) {
        machine.gap_response(i, g) += machine.W(k, i) * machine.response(k, g);
      }
    }
  }
}

void MachineFamily::frequencies(const Eigen::VectorXd& values, Eigen::VectorXd& frequencies) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    frequencies[static_cast<Eigen::Index>(g)] = groups_[g].frequency;
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    if (unknowns_[k].kind != Kind::frequency) continue;
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknowns_[k].index < 0) {
      frequencies *= value;
    } else {
      frequencies[unknowns_[k].index] = value;
    }
  }
  frequencies /= clock_scale(values);
}

Eigen::VectorXd MachineFamily::inputs(const Eigen::VectorXd& values) const {
  Eigen::VectorXd of_values(driving() + constant_forces_.cols() + contacts());
  inputs(values, of_values);
  return of_values;
}

void MachineFamily::inputs(const Eigen::VectorXd& values, Eigen::VectorXd& inputs) const {
  const auto G = static_cast<Eigen::Index>(groups_.size());
  // Amplitude and phase of each group; converted to a and b at the end.
  for (Eigen::Index g = 0; g < G; ++g) {
    inputs[2 * g] = groups_[static_cast<std::size_t>(g)].amplitude;
    inputs[2 * g + 1] = groups_[static_cast<std::size_t>(g)].phase;
  }
  for (std::size_t r = 0; r < records_.size(); ++r) {
    inputs[gain_input(static_cast<int>(r))] = records_[r].input->settings().gain;
  }
  inputs.segment(driving(), constant_forces_.cols()).setOnes();
  for (int i = 0; i < contacts(); ++i) {
    inputs[clearance_input(i)] = scene_.model.contacts[static_cast<std::size_t>(i)].clearance;
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknown.index >= 0) {
      if (unknown.kind == Kind::amplitude) inputs[harmonic_input(unknown.index)] = value;
      if (unknown.kind == Kind::phase) inputs[harmonic_input(unknown.index) + 1] = value;
    }
    if (unknown.kind == Kind::constant) {
      inputs[constant_input(unknown.index)] = value / unknown.nominal;
    }
    if (unknown.kind == Kind::clearance) inputs[clearance_input(unknown.index)] = value;
    if (unknown.kind == Kind::gain) inputs[gain_input(unknown.index)] = value;
  }
  for (std::size_t k = 0; k < unknowns_.size(); ++k) {
    const Unknown& unknown = unknowns_[k];
    const double value = values[static_cast<Eigen::Index>(k)];
    if (unknown.index >= 0) continue;
    const bool turns = unknown.kind == Kind::phase || unknown.kind == Kind::clock_offset;
    if (!turns && unknown.kind != Kind::amplitude) continue;
    Eigen::VectorXd rates = Eigen::VectorXd::Ones(G);
    if (unknown.kind == Kind::clock_offset) {
      frequencies(values, rates);
      rates = -rates;
    }
    const double by = unknown.kind == Kind::clock_offset ? clock_shift(values) : value;
    for (Eigen::Index g = 0; g < G; ++g) {
      if (turns) {
        inputs[2 * g + 1] += rates[g] * by;
      } else {
        inputs[2 * g] *= value;
      }
    }
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
  const double value = values[static_cast<Eigen::Index>(k)];
  switch (unknown.kind) {
    case Kind::phase:
    case Kind::amplitude:
      for (int g = 0; g < static_cast<int>(groups_.size()); ++g) {
        if (unknown.index >= 0 && unknown.index != g) continue;
        const Eigen::Index a = harmonic_input(g);
        if (unknown.kind == Kind::phase) {
          rate[a] = -at[a + 1];
          rate[a + 1] = at[a];
        } else {
          rate.segment(a, 2) = at.segment(a, 2) / value;
        }
      }
      break;
    case Kind::constant:
      rate[constant_input(unknown.index)] = 1.0 / unknown.nominal;
      break;
    case Kind::gain:
      rate[gain_input(unknown.index)] = 1.0;
      break;
    default:
      rate[clearance_input(unknown.index)] = 1.0;
  }
  return rate;
}

Scene MachineFamily::as_timed(const Eigen::VectorXd& values) const {
  Scene scene = with(scene_, unknowns_, values);
  const double scale = clock_scale(values), shift = clock_shift(values);
  scene.clock = scene_.clock;
  if (scale == 1.0 && shift == 0.0) return scene;
  const auto slow_down = [&](Harmonic& harmonic) {
    harmonic.frequency /= scale;
    harmonic.phase -= harmonic.frequency * shift;
  };
  Model& model = scene.model;
  model.C /= scale;
  model.K /= square(scale);
  for (Force& force : model.forces) {
    force.constant /= square(scale);
    force.harmonic.amplitude /= square(scale);
    slow_down(force.harmonic);
  }
  for (Contact& contact : model.contacts) slow_down(contact.motion);
  if (scene.frame) slow_down(scene.frame->motion);
  if (!scene.beam) return scene;
  scene.beam->bending_stiffness /= square(scale);
  scene.beam->damping /= scale;
  return scene;
}

}  // namespace sprag
