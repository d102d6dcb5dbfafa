/// \file
/// \brief Reduces a machine to some of its modes, with two corrections for the flexibility of the
/// omitted modes at the contacts.
///
/// Static vectors (Ritz vectors; Wilson, Yuan & Dickens, Earthq. Eng. Struct. Dyn. 10, 1982) of a
/// contact: the motion of the omitted modes under its impulse, and under its steady force,
///
///     b_0 = M^-1 w - Phi Phi^T w,  b_j = K^-1 M b_(j-1),  Phi the kept modes,
///
/// M-orthonormalized and appended to the kept modes. With b_0 the matrix G = W^T M^-1 W equals that
/// of all modes. With b_1 the contact's static flexibility does as well.
///
/// Effective restitution: the replica applies the share x of the impulse of each pulse,
///
///     u+ = u- - x (1 + epsilon) M^-1 w G^-1 min(gamma-, 0),
///
/// which is the restitution x (1 + epsilon) - 1. It expands no distance while that is in [-1, 1].
///
/// Coordinates and contacts are counted from 0.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "sprag/scene.h"

namespace sprag {

/// \brief A machine whose M, C and K are diagonal, with its observed quantities. After
/// with_static_vectors() C may couple the static vectors.
struct ModalMachine {
  Model model;                  ///< f coordinates
  State master, replica;        ///< starts, f entries each
  Eigen::MatrixXd observed;     ///< rows x f: the tip of a beam, else the gap at each contact
  Eigen::VectorXd uncertainty;  ///< Prior::uncertainty by coordinate; empty: not given
  State sigma = {};             ///< Prior::sigma by coordinate, uncorrelated; empty: not given
};

/// \brief Transforms a scene to its modes. A scene that is diagonal already keeps its coordinates.
/// \param scene the scene.
/// \return the machine in modal coordinates.
/// \throws ModelError if damping couples the modes.
ModalMachine modal_machine(const Scene& scene);

/// \brief Keeps some coordinates only.
/// \param machine the machine.
/// \param kept coordinates, in the order of the result.
/// \return the reduced machine.
ModalMachine reduced(const ModalMachine& machine, const std::vector<Eigen::Index>& kept);

/// \brief Keeps some coordinates and appends static vectors b_j of every contact.
///
/// A vector that depends linearly on those before it is omitted. The static vectors are
/// transformed to their own modes, with mass 1 and a diagonal K.
/// \param machine the machine.
/// \param kept coordinates, in the order of the result.
/// \param orders the numbers j, ascending.
/// \param least_zeta smallest damping ratio of the static vectors.
/// \return the reduced machine.
/// \throws ModelError if a motion without stiffness is omitted and some j > 0.
ModalMachine with_static_vectors(const ModalMachine& machine, const std::vector<Eigen::Index>& kept,
                                 std::span<const int> orders, double least_zeta = 0.0);

/// \brief Sets the replica's restitution of every contact to x (1 + epsilon) - 1, clamped to
/// [-1, 1].
/// \param x share of the impulse, >= 0.
/// \param model model to change.
void set_impulse_share(double x, Model& model);

/// \brief Scene of a reduced machine, as a [system].
///
/// A master that starts inside a support because modes are missing gets penetration = "release".
/// Keys of [parameters] and [adapt] that the scene no longer has, such as those of a beam and of
/// single entries of K, are left out; Scene::remarks names them.
/// \param scene original scene; gives the name, the prior and the flags of the master.
/// \param machine reduced machine.
/// \return the scene.
/// \throws ModelError if the direction of a contact is zero in the kept coordinates.
Scene reduced_scene(const Scene& scene, const ModalMachine& machine);

/// \brief Static vectors that a scene appends to its kept modes.
struct StaticVectors {
  std::vector<int> orders;  ///< the numbers j of b_j, ascending; empty: none
  double least_zeta = 0.0;  ///< smallest damping ratio of the static vectors, >= 0
};

/// \brief Finds the first modes of a machine, and static vectors of its contacts.
///
/// Damping may couple the modes. The sign of each column is such that its largest entry is
/// positive.
///
/// \param model the machine, N coordinates.
/// \param modes number of modes to keep, by ascending frequency, in [1, N].
/// \param vectors static vectors to append. A vector that depends linearly on those before it is
/// omitted.
/// \return the coordinates, f = modes + number of static vectors.
/// \throws ModelError if a motion without stiffness is omitted and some order is > 0.
KeptModes kept_modes(const Model& model, int modes, const StaticVectors& vectors = {});

/// \brief Projects a machine to its kept modes: M = 1, K diagonal, C = Phi^T C Phi.
///
/// Clearances and motions of supports keep their values, so that gaps, forces and outputs are those
/// of the given coordinates q_given = Phi q.
/// \param model the machine, N coordinates.
/// \param kept result of kept_modes() for this machine.
/// \param least_zeta smallest damping ratio of the static vectors.
/// \return the machine, f coordinates.
Model projected(const Model& model, const KeptModes& kept, double least_zeta = 0.0);

/// \brief Projects a state to the kept modes.
/// \param state N entries each.
/// \param kept the kept modes.
/// \return the nearest state in the norm of M, f entries each.
State projected(const State& state, const KeptModes& kept);

/// \brief State in the given coordinates.
/// \param state f entries each.
/// \param kept the kept modes.
/// \return Phi q and Phi u, N entries each.
State expanded(const State& state, const KeptModes& kept);

/// \brief Order of the coordinates by ascending frequency.
/// \param machine the machine.
/// \return numbers of all coordinates.
std::vector<Eigen::Index> by_frequency(const ModalMachine& machine);

/// \brief Scene in modal coordinates, by ascending frequency.
/// \param scene the scene.
/// \param modes number of the lowest modes to keep; 0: all, and a beam, which is in modal
/// coordinates already, is returned unchanged.
/// \return the scene.
/// \throws ModelError as modal_machine() and reduced_scene() do.
Scene in_modes(const Scene& scene, int modes);

}  // namespace sprag
