// The machines that the unknowns of a scene span, in coordinates y with q = V y and V^T M V = I:
//
//   y'' + C y' + K y = F(t),   g_i = w_i^T y + s_i(t) + c_i,   u+ = u- - jump_i gamma_i-,
//   jump_i = (1 + epsilon_i) w_i / (w_i^T w_i).
//
// What drives them is linear in a few *inputs*: for each group of harmonics a and b, the harmonic
// being a cos(Omega t) - b sin(Omega t) = Re (a + i b) e^(i Omega t), a factor on each constant
// force, and each clearance.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

/// One of them, but for its inputs. n coordinates, m contacts, G groups of harmonics, J constant
/// forces.
struct Machine {
  bool modal = false;               ///< C and K are diagonal
  Eigen::MatrixXd C, K;             ///< n x n, or n x 1: their diagonals
  Eigen::MatrixXd W;                ///< n x m
  Eigen::MatrixXd jump;             ///< n x m
  Eigen::VectorXd frequencies;      ///< G
  Eigen::MatrixXcd response;        ///< n x G: the steady y of a harmonic 1 e^(i Omega t)
  Eigen::MatrixXcd gap_response;    ///< m x G: what it and the support's motion make of the gaps
  Eigen::MatrixXd constant_forces;  ///< n x J
  Eigen::VectorXd positions;        ///< x_c by contact, where it is sought; else not a number

  Eigen::Index n() const { return W.rows(); }
  Eigen::Index groups() const { return frequencies.size(); }
  /// 2 G + J + m.
  Eigen::Index inputs() const { return 2 * groups() + constant_forces.cols() + W.cols(); }
};

/// Forces F e^(i Omega t), n x c, become the steady motion y e^(i Omega t) that they cause.
void set_steady_response(const Machine& machine, double Omega, Eigen::Ref<Eigen::MatrixXcd> F);

/// Whether what is beside the diagonal is rounding.
bool is_nearly_diagonal(const Eigen::MatrixXd& A);

class MachineFamily {
 public:
  /// Throws ModelError where M is not positive definite.
  MachineFamily(const Scene& scene, std::vector<Unknown> unknowns);

  const Scene& scene() const { return scene_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  Eigen::Index n() const { return scene_.model.coordinates(); }
  int contacts() const { return static_cast<int>(scene_.model.contacts.size()); }

  /// The values are those of all unknowns, those of the inputs included, in their order.
  Machine at(const Eigen::VectorXd& values) const;
  Eigen::VectorXd inputs(const Eigen::VectorXd& values) const;
  /// The same in place of another one, or of other inputs, of this family; without allocating where
  /// that one is modal.
  void at(const Eigen::VectorXd& values, Machine& machine) const;
  void inputs(const Eigen::VectorXd& values, Eigen::VectorXd& inputs) const;
  /// The frequencies of the groups of harmonics.
  void frequencies(const Eigen::VectorXd& values, Eigen::VectorXd& frequencies) const;
  /// Whether all of them are modal.
  bool modal() const { return modal_; }
  /// d inputs / d value of the unknown number k, which is a linear one.
  Eigen::VectorXd inputs_rate(const Eigen::VectorXd& values, std::size_t k) const;

  Eigen::VectorXd nominal() const;

  const std::vector<HarmonicGroup>& groups() const { return groups_; }
  /// Numbers of the inputs: a of a group (b is the next), a constant force's, a clearance.
  Eigen::Index harmonic_input(int group) const { return Eigen::Index{2} * group; }
  Eigen::Index constant_input(int force) const;
  Eigen::Index clearance_input(int contact) const;

  const Eigen::MatrixXd& V() const { return V_; }
  /// y of q.
  Eigen::VectorXd to_modes(const Eigen::VectorXd& q) const { return V_inverse_ * q; }

  /// The scene with these values: beam, model and positions.
  Scene with(const Eigen::VectorXd& values) const;

 private:
  void set_flow(const Eigen::VectorXd& values, Machine& machine) const;
  void set_position(int contact, double position, Machine& machine) const;
  void set(const Unknown& unknown, double value, Scene& scene) const;
  void set_restitution(int index, double value, Model& model) const;
  void set_harmonics(const Unknown& unknown, double value, Scene& scene) const;
  // change(harmonic, group, whether it is an acceleration) for the harmonics of the group with this
  // index, -1: of all groups.
  template <class Change>
  void change_harmonics(Scene& scene, int index, const Change& change) const;

  Scene scene_;
  std::vector<Unknown> unknowns_;
  std::vector<HarmonicGroup> groups_;
  std::vector<int> constants_;  // forces with a constant
  Eigen::MatrixXd V_, V_inverse_;
  bool modal_ = false;
  bool restitutions_differ_ = false;
  Eigen::MatrixXd C_, K_, W_;             // of the scene as it is, in y
  std::vector<Eigen::VectorXcd> forces_;  // of each group at amplitude 1, n entries
  Eigen::MatrixXcd motions_;              // and the supports', m x G
  Eigen::MatrixXd constant_forces_;       // n x J
};

}  // namespace sprag
