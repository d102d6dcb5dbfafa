// The machines that the unknowns of a scene span, in coordinates y with q = V y and V^T M V = I:
//
//   y'' + C y' + K y = F(t),   g_i = w_i^T y + s_i(t) + c_i,   u+ = u- - jump_i gamma_i-,
//   jump_i = (1 + epsilon_i) w_i / (w_i^T w_i).
//
// The motion is linear in a few *inputs*: a and b of each group of harmonics, where the harmonic is
// a cos(Omega t) - b sin(Omega t) = Re (a + i b) e^(i Omega t); a factor on each constant force;
// and each clearance.
//
// t is the time of the events by the nominal contact clock. With another rate and offset of the
// clock the machine's time is (t - shift) / scale (clock_scale(), clock_shift()). In t the machine
// has C / scale, K / scale^2, F / scale^2 and Omega / scale.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

/// One machine of the family, without its inputs. n coordinates, m contacts, G groups of harmonics,
/// J constant forces.
struct Machine {
  bool modal = false;               ///< C and K are diagonal
  Eigen::MatrixXd C, K;             ///< n x n, or their diagonals n x 1 if modal
  Eigen::MatrixXd W;                ///< n x m
  Eigen::MatrixXd jump;             ///< n x m
  Eigen::VectorXd frequencies;      ///< G
  Eigen::MatrixXcd response;        ///< n x G: steady y of a harmonic e^(i Omega t)
  Eigen::MatrixXcd gap_response;    ///< m x G: gaps by that y and the support's motion
  Eigen::MatrixXd constant_forces;  ///< n x J
  Eigen::VectorXd positions;        ///< x_c of each contact if it is an unknown, else NaN

  Eigen::Index n() const { return W.rows(); }
  Eigen::Index groups() const { return frequencies.size(); }
  /// 2 G + J + m.
  Eigen::Index inputs() const { return 2 * groups() + constant_forces.cols() + W.cols(); }
};

/// Replaces forces F e^(i Omega t), n x c, by the steady motions y e^(i Omega t) that they cause.
void set_steady_response(const Machine& machine, double Omega, Eigen::Ref<Eigen::MatrixXcd> F);

/// Whether the off-diagonal entries are rounding.
bool is_nearly_diagonal(const Eigen::MatrixXd& A);

class MachineFamily {
 public:
  /// Throws ModelError if M is not positive definite.
  MachineFamily(const Scene& scene, std::vector<Unknown> unknowns);

  const Scene& scene() const { return scene_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  Eigen::Index n() const { return scene_.model.coordinates(); }
  int contacts() const { return static_cast<int>(scene_.model.contacts.size()); }

  /// `values` are those of all unknowns in their order, the linear ones included.
  Machine at(const Eigen::VectorXd& values) const;
  Eigen::VectorXd inputs(const Eigen::VectorXd& values) const;
  /// The same in place. `machine` and `inputs` must come from this family. Does not allocate if the
  /// machine is modal.
  void at(const Eigen::VectorXd& values, Machine& machine) const;
  void inputs(const Eigen::VectorXd& values, Eigen::VectorXd& inputs) const;
  /// Rate of the contact clock over its nominal rate.
  double clock_scale(const Eigen::VectorXd& values) const;
  /// t at which the machine's time is 0 [s].
  double clock_shift(const Eigen::VectorXd& values) const;
  /// The frequencies of the groups of harmonics in t.
  void frequencies(const Eigen::VectorXd& values, Eigen::VectorXd& frequencies) const;
  /// Whether all machines of the family are modal.
  bool modal() const { return modal_; }
  /// d inputs / d value of unknown number k, which must be a linear one.
  Eigen::VectorXd inputs_rate(const Eigen::VectorXd& values, std::size_t k) const;

  Eigen::VectorXd nominal() const;

  const std::vector<HarmonicGroup>& groups() const { return groups_; }
  /// Indices of the inputs: a of a group (b is the next one), a constant force's factor, a
  /// clearance.
  Eigen::Index harmonic_input(int group) const { return Eigen::Index{2} * group; }
  Eigen::Index constant_input(int force) const;
  Eigen::Index clearance_input(int contact) const;

  const Eigen::MatrixXd& V() const { return V_; }
  /// y for q.
  Eigen::VectorXd to_modes(const Eigen::VectorXd& q) const { return V_inverse_ * q; }

  /// The scene with these values, in its beam, model, positions and clock.
  Scene with(const Eigen::VectorXd& values) const;
  /// The same machine with t as its time and with the nominal clock.
  Scene as_timed(const Eigen::VectorXd& values) const;

 private:
  void set_flow(const Eigen::VectorXd& values, Machine& machine) const;
  void set_position(int contact, double position, Machine& machine) const;
  void set(const Unknown& unknown, double value, Scene& scene) const;
  void set_restitution(int index, double value, Model& model) const;
  void set_harmonics(const Unknown& unknown, double value, Scene& scene) const;
  // Calls change(harmonic, group, is_acceleration) for the harmonics of the group with this index;
  // -1: of all groups.
  template <class Change>
  void change_harmonics(Scene& scene, int index, const Change& change) const;

  Scene scene_;
  std::vector<Unknown> unknowns_;
  std::vector<HarmonicGroup> groups_;
  std::vector<int> constants_;  // forces with a constant
  Eigen::MatrixXd V_, V_inverse_;
  bool modal_ = false;
  bool restitutions_differ_ = false;
  Eigen::MatrixXd C_, K_, W_;             // of the nominal scene, in y
  std::vector<Eigen::VectorXcd> forces_;  // of each group at amplitude 1, n entries
  Eigen::MatrixXcd motions_;              // and the supports' motions, m x G
  Eigen::MatrixXd constant_forces_;       // n x J
};

}  // namespace sprag
