#include "sprag/reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Coupling of modes by damping below this share is rounding.
constexpr double uncoupled = 1e-9;
// The same as a share of the largest entry of C.
constexpr double rounded_sum = 1e-13;
constexpr double rounded_entry = 1e-15;
// The same for damping computed in extended precision.
constexpr Extended rounding_of_products = 1e-15L;
// A vector with a smaller remainder after orthogonalization depends on those before it.
constexpr Extended dependent = 1e-10L;

MatrixXd observed(const Scene& scene) {
  if (scene.beam) return mode_shapes(*scene.beam, scene.beam->length).transpose();
  MatrixXd rows(static_cast<Index>(scene.model.contacts.size()), scene.model.coordinates());
  for (Index i = 0; i < rows.rows(); ++i) {
    rows.row(i) = scene.model.contacts[static_cast<std::size_t>(i)].w.transpose();
  }
  return rows;
}

std::vector<Index> all(const ModalMachine& machine) {
  std::vector<Index> indices(static_cast<std::size_t>(machine.model.coordinates()));
  std::iota(indices.begin(), indices.end(), Index{0});
  return indices;
}

VectorR masses(const ModalMachine& machine) { return machine.model.M.diagonal().cast<Extended>(); }

// Makes b M-orthogonal to the basis and of length 1; two passes are enough (Giraud, Langou &
// Rozloznik 2005). Returns whether b is independent of the basis.
bool orthonormalize(const VectorR& m, const std::vector<VectorR>& basis, VectorR& b) {
  const auto shrink = [&] {
    const Extended length = std::sqrt(b.cwiseAbs2().cwiseProduct(m).sum());
    if (length > 0) b /= length;
    return length;
  };
  if (!(shrink() > 0)) return false;
  for (int pass = 0; pass < 2; ++pass) {
    for (const VectorR& other : basis) b -= b.cwiseProduct(m).cwiseProduct(other).sum() * other;
    if (!(shrink() > dependent)) return false;
  }
  return true;
}

// Columns b_j of every contact, M-orthonormal; zero at the kept coordinates.
MatrixR static_vectors(const ModalMachine& machine, const std::vector<Index>& kept,
                       std::span<const int> orders) {
  const VectorR m = masses(machine);
  const VectorR k = machine.model.K.diagonal().cast<Extended>();
  VectorR left_out = VectorR::Ones(m.size());
  left_out(kept).setZero();
  if (!orders.empty() && orders.back() > 0 &&
      (left_out.array() * (k.array() <= 0).cast<Extended>()).any()) {
    throw ModelError("a motion without stiffness is left out: it has no static vector");
  }
  std::vector<VectorR> basis;
  for (const int j : orders) {
    for (const Contact& contact : machine.model.contacts) {
      VectorR b = left_out.cwiseProduct(contact.w.cast<Extended>()).cwiseQuotient(m);
      for (Index c = 0; c < b.size(); ++c) {
        if (left_out[c] != 0) b[c] *= std::pow(m[c] / k[c], static_cast<Extended>(j));
      }
      if (orthonormalize(m, basis, b)) basis.push_back(b);
    }
  }
  MatrixR B(m.size(), static_cast<Index>(basis.size()));
  for (Index i = 0; i < B.cols(); ++i) B.col(i) = basis[static_cast<std::size_t>(i)];
  return B;
}

// The static vectors in modes of their own, so that K stays diagonal.
struct StaticModes {
  VectorR kappa;
  MatrixR B;
};

StaticModes static_modes(const ModalMachine& machine, const std::vector<Index>& kept,
                         std::span<const int> orders) {
  StaticModes modes{VectorR(0), static_vectors(machine, kept, orders)};
  if (modes.B.cols() == 0) return modes;
  const MatrixR K = machine.model.K.cast<Extended>();
  const auto [kappa, V] = eigenpairs(congruent(modes.B, K));
  modes.kappa = kappa;
  modes.B = product(modes.B, V);
  return modes;
}

// The sign of an eigenvector depends on the solver. Programs of different builds must agree on the
// coordinates: the first entry that has the largest magnitude, up to rounding, is positive.
void fix_signs(MatrixXd& Phi) {
  for (Index i = 0; i < Phi.cols(); ++i) {
    const double largest = Phi.col(i).cwiseAbs().maxCoeff();
    for (Index j = 0; j < Phi.rows(); ++j) {
      if (std::abs(Phi(j, i)) < (1.0 - 1e-6) * largest) continue;
      if (Phi(j, i) < 0.0) Phi.col(i) *= -1.0;
      break;
    }
  }
}

// Couplings and damping that are rounding become 0.
void remove_rounding(MatrixXd& C) {
  const double largest = C.cwiseAbs().maxCoeff();
  for (Index i = 0; i < C.rows(); ++i) {
    if (C(i, i) > rounded_entry * largest) continue;
    C.row(i).setZero();
    C.col(i).setZero();
  }
  for (Index i = 0; i < C.rows(); ++i) {
    for (Index j = 0; j < C.cols(); ++j) {
      const double limit =
          std::max(uncoupled * std::sqrt(std::abs(C(i, i) * C(j, j))), rounded_sum * largest);
      if (i != j && std::abs(C(i, j)) <= limit) C(i, j) = 0.0;
    }
  }
}

MatrixXd block_diagonal(const MatrixXd& first, const MatrixXd& second) {
  const Index n = first.rows();
  const Index r = second.rows();
  MatrixXd blocks = MatrixXd::Zero(n + r, n + r);
  blocks.topLeftCorner(n, n) = first;
  blocks.bottomRightCorner(r, r) = second;
  return blocks;
}

VectorXd joined(const VectorXd& first, const VectorXd& second) {
  VectorXd both(first.size() + second.size());
  both << first, second;
  return both;
}

// Standard deviations of T x, where the entries of x are independent.
VectorXd deviations(const MatrixXd& T, const VectorXd& sigma) {
  return T.cwiseAbs2().lazyProduct(sigma.cwiseAbs2()).cwiseSqrt();
}

// Whether a key is of the same parameter in both scenes. Entries are of coordinates.
bool is_same(const Scene& scene, const Scene& part, const std::string& key) {
  try {
    const Parameter a = parameter_of(scene, key);
    const Parameter b = parameter_of(part, key);
    return a.unit == b.unit && a.nominal == b.nominal && !is_of_entry(key);
  } catch (const std::invalid_argument&) {
    return false;
  }
}

// Removes the keys of other parameters from the prior, and names them.
void keep_parameters(const Scene& scene, Scene& part) {
  const ParameterUncertainty& all = scene.prior.parameters;
  ParameterUncertainty& kept = part.prior.parameters = {};
  std::vector<Index> at;
  const auto leave_out = [&](const std::string& what) {
    part.remarks.push_back(what + " is left out: the reduced scene has no such parameter");
  };
  for (std::size_t i = 0; i < all.keys.size(); ++i) {
    if (!is_same(scene, part, all.keys[i])) {
      leave_out(all.keys[i] + " of [parameters]");
      continue;
    }
    at.push_back(static_cast<Index>(i));
    kept.keys.push_back(all.keys[i]);
    kept.consider.push_back(all.consider[i]);
  }
  kept.sigma = all.sigma(at);
  kept.correlation = all.correlation(at, at);
  for (const std::string& key : scene.prior.adaptation.free) {
    if (is_same(scene, part, key)) continue;
    leave_out("[adapt] with " + key);
    part.prior.adaptation = {};
    break;
  }
}

bool starts_inside(const Model& model, const State& start) {
  return std::any_of(model.contacts.begin(), model.contacts.end(),
                     [&](const Contact& contact) { return gap(contact, start.q, 0.0) < 0.0; });
}

}  // namespace

ModalMachine modal_machine(const Scene& scene) {
  const Model& model = scene.model;
  ModalMachine machine{
      model,           scene.truth.start,       scene.prior.start,
      observed(scene), scene.prior.uncertainty, scene.prior.sigma.value_or(State{})};
  if (model.M.isDiagonal(0.0) && model.C.isDiagonal(0.0) && model.K.isDiagonal(0.0)) {
    return machine;
  }
  const auto [kappa, Phi] = eigenpairs(model.K, model.M);
  const MatrixXd C = congruent(Phi, model.C);
  const MatrixXd coupling = C - MatrixXd(C.diagonal().asDiagonal());
  if (coupling.cwiseAbs().maxCoeff() > uncoupled * C.cwiseAbs().maxCoeff()) {
    throw ModelError("damping couples the modes; none of them can be left out");
  }
  machine.model.M = MatrixXd::Identity(Phi.rows(), Phi.cols());
  machine.model.C = C.diagonal().cwiseMax(0.0).asDiagonal();
  machine.model.K = kappa.cwiseMax(0.0).asDiagonal();
  for (Force& force : machine.model.forces) force.direction = Phi.transpose() * force.direction;
  for (Contact& contact : machine.model.contacts) contact.w = Phi.transpose() * contact.w;
  for (Output& output : machine.model.outputs) {
    output.direction = Phi.transpose() * output.direction;
  }
  for (State* state : {&machine.master, &machine.replica}) {
    state->q = Phi.transpose() * (model.M * state->q);
    state->u = Phi.transpose() * (model.M * state->u);
  }
  if (State& sigma = machine.sigma; sigma.q.size() > 0) {
    const MatrixXd to_modes = product(Phi.transpose(), model.M);
    sigma = {deviations(to_modes, sigma.q), deviations(to_modes, sigma.u)};
  }
  machine.observed = product(machine.observed, Phi);
  return machine;
}

ModalMachine reduced(const ModalMachine& machine, const std::vector<Index>& kept) {
  const auto of = [&](const VectorXd& x) { return VectorXd(x(kept)); };
  ModalMachine part = machine;
  part.model.M = of(machine.model.M.diagonal()).asDiagonal();
  part.model.C = of(machine.model.C.diagonal()).asDiagonal();
  part.model.K = of(machine.model.K.diagonal()).asDiagonal();
  for (Force& force : part.model.forces) force.direction = of(force.direction);
  for (Contact& contact : part.model.contacts) contact.w = of(contact.w);
  for (Output& output : part.model.outputs) output.direction = of(output.direction);
  for (State* state : {&part.master, &part.replica}) {
    state->q = of(state->q);
    state->u = of(state->u);
  }
  if (part.uncertainty.size() > 0) part.uncertainty = of(part.uncertainty);
  if (part.sigma.q.size() > 0) part.sigma = {of(part.sigma.q), of(part.sigma.u)};
  part.observed = machine.observed(Eigen::all, kept);
  return part;
}

ModalMachine with_static_vectors(const ModalMachine& machine, const std::vector<Index>& kept,
                                 std::span<const int> orders, double least_zeta) {
  ModalMachine part = reduced(machine, kept);
  const auto [kappa, B] = static_modes(machine, kept, orders);
  if (B.cols() == 0) return part;
  MatrixR C = congruent(B, machine.model.C.cast<Extended>());
  C = MatrixR(C + C.transpose()) / 2;
  for (Index i = 0; i < C.rows(); ++i) {
    C(i, i) = std::max(C(i, i), 2 * static_cast<Extended>(least_zeta) * std::sqrt(kappa[i]));
  }
  for (Index i = 0; i < C.rows(); ++i) {
    for (Index j = 0; j < C.rows(); ++j) {
      if (i != j && std::abs(C(i, j)) <= rounding_of_products * std::sqrt(C(i, i) * C(j, j)))
        C(i, j) = 0;
    }
  }
  const MatrixXd Bd = B.cast<double>();
  const MatrixXd to_static = (B.transpose() * masses(machine).asDiagonal()).cast<double>();
  Model& model = part.model;
  const Index r = B.cols();
  model.M = block_diagonal(model.M, MatrixXd::Identity(r, r));
  model.C = block_diagonal(model.C, C.cast<double>());
  model.K = block_diagonal(model.K, kappa.cast<double>().asDiagonal());
  for (std::size_t i = 0; i < model.forces.size(); ++i) {
    VectorXd& direction = model.forces[i].direction;
    direction = joined(direction, Bd.transpose() * machine.model.forces[i].direction);
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    VectorXd& w = model.contacts[i].w;
    w = joined(w, Bd.transpose() * machine.model.contacts[i].w);
  }
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    VectorXd& direction = model.outputs[i].direction;
    direction = joined(direction, Bd.transpose() * machine.model.outputs[i].direction);
  }
  for (State ModalMachine::*state : {&ModalMachine::master, &ModalMachine::replica}) {
    (part.*state).q = joined((part.*state).q, to_static * (machine.*state).q);
    (part.*state).u = joined((part.*state).u, to_static * (machine.*state).u);
  }
  if (part.uncertainty.size() > 0) {
    VectorXd left_out = machine.uncertainty;
    left_out(kept).setZero();
    // Spread evenly: its distribution over the static vectors is not known.
    part.uncertainty =
        joined(part.uncertainty, VectorXd::Constant(r, left_out.sum() / static_cast<double>(r)));
  }
  if (State& sigma = part.sigma; sigma.q.size() > 0) {
    sigma = {joined(sigma.q, deviations(to_static, machine.sigma.q)),
             joined(sigma.u, deviations(to_static, machine.sigma.u))};
  }
  const MatrixXd kept_rows = part.observed;
  part.observed.resize(kept_rows.rows(), kept_rows.cols() + r);
  part.observed << kept_rows, product(machine.observed, Bd);
  return part;
}

void set_impulse_share(double x, Model& model) {
  for (Contact& contact : model.contacts) {
    contact.replica_restitution = std::clamp(x * (1.0 + contact.restitution) - 1.0, -1.0, 1.0);
  }
}

Scene reduced_scene(const Scene& scene, const ModalMachine& machine) {
  for (std::size_t i = 0; i < machine.model.contacts.size(); ++i) {
    if (machine.model.contacts[i].w.squaredNorm() > 0.0) continue;
    throw ModelError("contact " + std::to_string(i + 1) + " does not see the modes that are kept");
  }
  Scene part;
  part.name = scene.name + "_reduced";
  part.model = machine.model;
  part.truth.start = machine.master;
  part.prior = scene.prior;
  part.prior.start = machine.replica;
  part.prior.uncertainty = machine.uncertainty;
  if (machine.sigma.q.size() > 0) part.prior.sigma = machine.sigma;
  part.clock = scene.clock;
  part.truth.given = scene.truth.given;
  part.truth.release_penetration =
      scene.truth.release_penetration || starts_inside(part.model, part.truth.start);
  keep_parameters(scene, part);
  return part;
}

KeptModes kept_modes(const Model& model, int modes, const StaticVectors& vectors) {
  const auto [values, Phi] = eigenpairs(model.K, model.M);
  const Index N = Phi.rows();
  // Rounding gives a rigid motion a small stiffness of either sign.
  const double rigid = static_cast<double>(N) * std::numeric_limits<double>::epsilon() *
                       values.cwiseAbs().maxCoeff();
  const VectorXd kappa = (values.array() > rigid).select(values.array(), 0.0);
  KeptModes kept{.modes = modes,
                 .Phi = Phi.leftCols(modes),
                 .to_kept = {},
                 .stiffness = kappa.head(modes),
                 .C = model.C,
                 .K = model.K,
                 .given_w = {}};
  for (const Contact& contact : model.contacts) kept.given_w.push_back(contact.w);
  if (!vectors.orders.empty()) {
    ModalMachine machine;
    machine.model.M = MatrixXd::Identity(N, N);
    machine.model.K = kappa.asDiagonal();
    for (const Contact& contact : model.contacts) {
      machine.model.contacts.push_back({.w = Phi.transpose() * contact.w, .motion = {}});
    }
    std::vector<Index> first(static_cast<std::size_t>(modes));
    std::iota(first.begin(), first.end(), Index{0});
    const auto [of_vectors, B] = static_modes(machine, first, vectors.orders);
    kept.Phi.conservativeResize(N, modes + B.cols());
    kept.Phi.rightCols(B.cols()) = product(Phi, B.cast<double>());
    kept.stiffness = joined(kept.stiffness, of_vectors.cast<double>());
  }
  fix_signs(kept.Phi);
  kept.to_kept = product(kept.Phi.transpose(), model.M);
  return kept;
}

Model projected(const Model& model, const KeptModes& kept, double least_zeta) {
  const MatrixXd& Phi = kept.Phi;
  const Index f = Phi.cols();
  Model part = model;
  part.M = MatrixXd::Identity(f, f);
  part.K = kept.stiffness.asDiagonal();
  part.C = congruent(Phi, model.C);
  part.C = MatrixXd(part.C + part.C.transpose()) / 2.0;
  part.C.diagonal() = part.C.diagonal().cwiseMax(0.0).eval();
  for (Index i = kept.modes; i < f; ++i) {
    part.C(i, i) = std::max(part.C(i, i), 2.0 * least_zeta * std::sqrt(part.K(i, i)));
  }
  remove_rounding(part.C);
  for (Force& force : part.forces) force.direction = Phi.transpose() * force.direction;
  for (Contact& contact : part.contacts) contact.w = Phi.transpose() * contact.w;
  for (Output& output : part.outputs) output.direction = Phi.transpose() * output.direction;
  return part;
}

State projected(const State& state, const KeptModes& kept) {
  return {kept.to_kept * state.q, kept.to_kept * state.u};
}

State expanded(const State& state, const KeptModes& kept) {
  return {kept.Phi * state.q, kept.Phi * state.u};
}

std::vector<Index> by_frequency(const ModalMachine& machine) {
  std::vector<Index> order = all(machine);
  const VectorXd kappa = machine.model.K.diagonal().cwiseQuotient(machine.model.M.diagonal());
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return kappa[a] < kappa[b]; });
  return order;
}

Scene in_modes(const Scene& scene, int modes) {
  const bool whole = modes == 0;
  if (whole && scene.beam) return scene;
  const ModalMachine machine = modal_machine(scene);
  std::vector<Index> kept = by_frequency(machine);
  if (!whole) kept.resize(std::min(kept.size(), static_cast<std::size_t>(modes)));
  Scene modal = reduced_scene(scene, reduced(machine, kept));
  if (whole) modal.name = scene.name;
  return modal;
}

}  // namespace sprag
