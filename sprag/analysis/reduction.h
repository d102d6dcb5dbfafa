// A machine in some of its modes alone: what is left of M, C, K, W and f when the other modes are
// taken to rest at zero.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/mechanics/scene.h"

namespace sprag {

/// A machine whose M, C and K are diagonal, and what of it is looked at.
struct ModalMachine {
  Model model;
  State master, replica;     ///< f entries each
  Eigen::MatrixXd observed;  ///< rows x f: the tip of a beam, else the gap at each contact
};

/// The scene in its modes; a scene that is diagonal already keeps its coordinates. Throws
/// ModelError where damping couples the modes.
ModalMachine modal_machine(const Scene& scene);

/// Keeps those coordinates alone, in the order given.
ModalMachine reduced(const ModalMachine& machine, const std::vector<Eigen::Index>& kept);

/// All coordinates, by ascending frequency.
std::vector<Eigen::Index> by_frequency(const ModalMachine& machine);

/// All coordinates, those first that give way most at the contacts: max_i (w_i phi_k)^2 / kappa_k.
std::vector<Eigen::Index> by_share_in_contact(const ModalMachine& machine);

}  // namespace sprag
