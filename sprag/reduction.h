// A machine in some of its modes: what is left of M, C, K, W and f when the other modes are taken
// to rest at zero, and two corrections for what these give way at the contacts.
//
// Static vectors (Ritz vectors, as of Wilson, Yuan & Dickens, Earthq. Eng. Struct. Dyn. 10, 1982)
// of a contact: how the modes that are left out move under its impulse, and under its steady force,
//
//   b_0 = M^-1 w - Phi Phi^T w,  b_j = K^-1 M b_(j-1),  Phi the modes that are kept,
//
// M-orthonormalized and appended to these. With b_0 G = W^T M^-1 W is that of all modes, with b_1
// the contact's static flexibility as well.
//
// Effective restitution: the replica takes the share x of each pulse's impulse,
//
//   u+ = u- - x (1 + epsilon) M^-1 w G^-1 min(gamma-, 0),
//
// which is the restitution x (1 + epsilon) - 1. It expands no distance while that is in [-1, 1].
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

/// A machine whose M, C and K are diagonal, and what of it is looked at.
struct ModalMachine {
  Model model;
  State master, replica;        ///< f entries each
  Eigen::MatrixXd observed;     ///< rows x f: the tip of a beam, else the gap at each contact
  Eigen::VectorXd uncertainty;  ///< Scene::uncertainty by coordinate; empty: not given
};

/// The scene in its modes; a scene that is diagonal already keeps its coordinates. Throws
/// ModelError where damping couples the modes.
ModalMachine modal_machine(const Scene& scene);

/// Keeps those coordinates alone, in the order given.
ModalMachine reduced(const ModalMachine& machine, const std::vector<Eigen::Index>& kept);

/// The same and behind them the static vectors b_j of every contact, j in `orders`; what depends on
/// those before it is left out. Their masses are 1, and K is diagonal. Their damping ratios are at
/// least `least_zeta`. Throws ModelError if a motion without stiffness is left out and some j > 0.
ModalMachine with_static_vectors(const ModalMachine& machine, const std::vector<Eigen::Index>& kept,
                                 std::span<const int> orders, double least_zeta = 0.0);

/// The replica's restitution of every contact becomes x (1 + epsilon) - 1, within [-1, 1]; x >= 0.
void set_impulse_share(double x, Model& model);

/// The machine as a scene of its own, a [system], with the rest from the scene that it is made
/// from. A master that starts inside a support for want of modes is let out of it. Throws
/// ModelError if a contact does not see what is kept.
Scene reduced_scene(const Scene& scene, const ModalMachine& machine);

/// All coordinates, by ascending frequency.
std::vector<Eigen::Index> by_frequency(const ModalMachine& machine);

/// The scene in coordinates that are its modes, the `modes` lowest of them, by ascending frequency;
/// 0: all, and a beam, which is in them already, as it is. Throws ModelError as modal_machine() and
/// reduced_scene() do.
Scene in_modes(const Scene& scene, int modes);

}  // namespace sprag
