#include "sprag/analysis/reduction.h"

#include <algorithm>
#include <numeric>

#include "sprag/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Damping between modes below this share of their own is rounding.
constexpr double uncoupled = 1e-9;

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

}  // namespace

ModalMachine modal_machine(const Scene& scene) {
  const Model& model = scene.model;
  ModalMachine machine{model, scene.master, scene.replica, observed(scene)};
  if (model.M.isDiagonal(0.0) && model.C.isDiagonal(0.0) && model.K.isDiagonal(0.0)) {
    return machine;
  }
  const auto [kappa, Phi] = eigenpairs(model.K, model.M);
  const MatrixXd C = Phi.transpose() * model.C * Phi;
  const MatrixXd coupling = C - MatrixXd(C.diagonal().asDiagonal());
  if (coupling.cwiseAbs().maxCoeff() > uncoupled * C.cwiseAbs().maxCoeff()) {
    throw ModelError("damping couples the modes; none of them can be left out");
  }
  machine.model.M = MatrixXd::Identity(Phi.rows(), Phi.cols());
  machine.model.C = C.diagonal().cwiseMax(0.0).asDiagonal();
  machine.model.K = kappa.cwiseMax(0.0).asDiagonal();
  for (Force& force : machine.model.forces) force.direction = Phi.transpose() * force.direction;
  for (Contact& contact : machine.model.contacts) contact.w = Phi.transpose() * contact.w;
  for (State* state : {&machine.master, &machine.replica}) {
    state->q = Phi.transpose() * model.M * state->q;
    state->u = Phi.transpose() * model.M * state->u;
  }
  machine.observed *= Phi;
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
  for (State* state : {&part.master, &part.replica}) {
    state->q = of(state->q);
    state->u = of(state->u);
  }
  part.observed = machine.observed(Eigen::all, kept);
  return part;
}

std::vector<Index> by_frequency(const ModalMachine& machine) {
  std::vector<Index> order = all(machine);
  const VectorXd kappa = machine.model.K.diagonal().cwiseQuotient(machine.model.M.diagonal());
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return kappa[a] < kappa[b]; });
  return order;
}

std::vector<Index> by_share_in_contact(const ModalMachine& machine) {
  std::vector<Index> order = all(machine);
  VectorXd share = VectorXd::Zero(machine.model.coordinates());
  for (const Contact& contact : machine.model.contacts) {
    // A mode without stiffness gives way without limit.
    share = share.cwiseMax(contact.w.cwiseAbs2().cwiseQuotient(machine.model.K.diagonal()));
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return share[a] > share[b]; });
  return order;
}

}  // namespace sprag
